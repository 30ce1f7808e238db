// SPDX-License-Identifier: Apache-2.0
// Paths through keys: which motions the cubic reproduces, the derivative of the moved Gaussian, the
// device.
#include "optim/motion/keyframes.hpp"

#include <gtest/gtest.h>

#include "optim/density/adc.hpp"
#include "optim/reference/flat_static.hpp"
#include "tests/support/density_rule.hpp"
#include "tests/support/device.hpp"
#include "tests/support/motion_check.hpp"

namespace gflow {
namespace {

// The value at t of a path with these keys.
double path(const std::vector<double>& keys, double t, double duration = 2) {
  const KeyWeights w = key_weights(t, duration, int(keys.size()));
  EXPECT_GE(w.first, 0);
  EXPECT_LE(w.first + w.count, int(keys.size()));
  double sum = 0;
  for (int k = 0; k < w.count; ++k) sum += double(w.weight[k]) * keys[size_t(w.first + k)];
  return sum;
}

TEST(Keys, ThePathGoesThroughEveryKeyAndOnlyThatKeyCountsThere) {
  const std::vector<double> keys{3, -1, 4, 1, -5};
  for (size_t k = 0; k < 5; ++k) {
    const float t = float(2.0 * double(k) / 4);
    EXPECT_EQ(path(keys, double(t)), keys[k]);
    EXPECT_EQ(key_weights(double(t), 2, 5).count, 1);
  }
}

TEST(Keys, AStraightPathStaysStraightAndAParabolaBetweenInnerKeys) {
  for (size_t count = 1; count <= 6; ++count) {
    std::vector<double> line, parabola;
    const double steps = double(std::max<size_t>(count - 1, 1));
    for (size_t k = 0; k < count; ++k) {
      const double t = 2 * double(k) / steps;
      line.push_back(1 + 3 * t);
      parabola.push_back(t * t);
    }
    for (double t = 0; t <= 2; t += 0.03) {
      EXPECT_NEAR(path(line, t), count == 1 ? 1 : 1 + 3 * t, 1e-5);  // float weights
      const bool inner = count > 3 && t > 2 / steps && t < 2 - 2 / steps;
      if (inner) {
        EXPECT_NEAR(path(parabola, t), t * t, 1e-5);
      }
    }
    EXPECT_EQ(path(line, -1), line.front());  // constant outside of the video
    EXPECT_EQ(path(line, 5), line.back());
  }
}

TEST(Keys, TheSlopeHasNoJumpAtAKey) {
  const std::vector<double> keys{3, -1, 4, 1, -5};
  const double h = 1e-3;
  for (size_t k = 1; k < 4; ++k) {
    const double t = 2.0 * double(k) / 4, here = path(keys, t);
    EXPECT_NEAR((here - path(keys, t - h)) / h, (path(keys, t + h) - here) / h, 0.15);
    EXPECT_NEAR((path(keys, t + h) - path(keys, t - h)) / (2 * h), (keys[k + 1] - keys[k - 1]),
                0.02);
  }
}

TEST(Shifted, GradientEqualsCentralDifferences) {
  Random random(3);
  for (int i = 0; i < 30; ++i) {
    const std::vector<double> x = reference::random_still_and_shift(random);
    const double t = random(), v_opacity = random();
    const real3 v_mean = random.three();
    const Mat3 v_l = random.nine();
    const auto loss = [&](const std::vector<double>& y) {
      const Shifted o = shifted_at(reference::canonical_from(y), reference::shift_from(y), t);
      return dot(o.mean, v_mean) + o.life.opacity * v_opacity + dot(o.factor.r1, v_l.r1) +
             dot(o.factor.r2, v_l.r2) + dot(o.factor.r3, v_l.r3);
    };
    const std::vector<double> expected = numeric_gradient(loss, x);
    const Canonical v = shifted_vjp(reference::canonical_from(x), reference::shift_from(x), t,
                                    v_mean, v_l, v_opacity);
    EXPECT_TRUE(
        all_close(reference::canonical_and_shift(v), expected, {1e-6, 1e-6 * largest(expected)}));
  }
}

// ---- on the device

// Number of keys, whether scales have keys, and lanes: 0 the device's own, 1 as on GPUs.
class KeyframesOfSomeKeys : public testing::TestWithParam<std::tuple<int, bool, int>> {};
INSTANTIATE_TEST_SUITE_P(Motion, KeyframesOfSomeKeys,
                         testing::Combine(testing::Values(1, 2, 3, 7), testing::Bool(),
                                          testing::Values(0, 1)));

TEST_P(KeyframesOfSomeKeys, TheDeviceShowsAndDifferentiatesAsTheDoubleFormulas) {
  Queue queue = test_queue(std::get<2>(GetParam()));
  MotionShape shape;
  shape.motion = MotionModelKind::keyframes;
  shape.duration = 2;
  shape.keys = std::get<0>(GetParam());
  shape.key_scales = std::get<1>(GetParam());
  MotionCheck check(
      queue, shape, 37,
      [&](const Named& p, size_t i, double t) { return reference::keyframes_at(shape, p, i, t); },
      {{"key_turns", 0.2}});
  for (const double t : {0.0, 0.3, 1.0, 1.7, 2.0}) check.expect_same_gaussians(t, {1e-5, 1e-5});
  check.expect_same_gradients(0.4, 0.9, 1e-5);  // float32
}

TEST(Keyframes, OnAKeyOnlyItsRowsAreSeenAndActive) {
  Queue queue = test_queue();
  MotionShape shape;
  shape.motion = MotionModelKind::keyframes;
  shape.keys = 5;
  MotionCheck check(queue, shape, 3, {});
  Parameters& p = check.parameters();
  const Buffer<cl_uint> touched(queue, {1, 0, 1}, "touched");
  const Buffer<float> v(queue, std::vector<float>(27, 1.f), "v");
  check.motion().backward(queue, p, 0.5f, true, touched, v, v, v);
  EXPECT_EQ(p.more[0].rows.seen.read(queue),
            (std::vector<cl_uint>{0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(p.more[0].active.first, 6u);
  EXPECT_EQ(p.more[0].active.count, 3u);
  p.forget_seen(queue);
  EXPECT_EQ(p.more[0].rows.seen.read(queue), std::vector<cl_uint>(15, 0u));
}

// A new key extrapolates linearly from the two before it, or copies the first.
TEST(Keyframes, AKeyBeginsWhereThePathWasHeading) {
  Queue queue = test_queue();
  MotionShape shape;
  shape.motion = MotionModelKind::keyframes;
  shape.keys = 4;
  MotionCheck check(queue, shape, 5, {});
  Parameters& p = check.parameters();
  auto* motion = dynamic_cast<KeyframesMotion*>(&check.motion());
  ASSERT_TRUE(motion);
  const Named before = check.values();
  for (const int key : {1, 3}) motion->start_key(queue, p, key);
  for (const auto& [name, width] : {std::pair{"key_shifts", 3}, {"key_turns", 4}}) {
    const std::vector<float> after = p[name].values.read(queue);
    const std::vector<double>& was = before.at(name);
    const size_t block = 5 * size_t(width);
    for (size_t i = 0; i < block; ++i) {
      EXPECT_EQ(after[i], float(was[i]));
      EXPECT_EQ(after[block + i], float(was[i]));
      EXPECT_EQ(after[2 * block + i], float(was[2 * block + i]));
      EXPECT_EQ(after[3 * block + i], 2 * after[2 * block + i] - after[block + i]) << name << i;
    }
  }
  for (const int key : {0, 4}) EXPECT_THROW(motion->start_key(queue, p, key), Error);
}

TEST(Keyframes, ChildrenKeepTheirParentsPathThroughDensityControl) {
  Queue queue = test_queue();
  MotionShape shape;
  shape.motion = MotionModelKind::keyframes;
  shape.keys = 3;
  MotionCheck check(queue, shape, 4, {});
  Parameters& p = check.parameters();
  const Named before = check.values();
  p["log_scales"].values.fill(queue, -2);
  p["logit_opacities"].values.write(queue, {1, 1, -20, 1});  // the third one is removed
  p["means_t"].values.fill(queue, 0.5f);
  AdcDensity density(queue);
  DensityRule rule = quiet_rule();
  rule.grad_threshold = 1;
  rule.prune_scale = 10;
  rule.split.split_scale = 1;
  const Buffer<cl_uint> touched(queue, {1, 1, 1, 1}, "tiles");
  const Buffer<float> v(queue, {0, 0, 9, 0, 0, 0, 9, 0}, "v");
  density.see(queue, p, {20, 10, {}, touched, v});
  density.refine(queue, p, check.motion(), rule, 1);
  const size_t source[] = {0, 1, 1, 3, 3}, n = 5;  // one more than before
  ASSERT_EQ(p.count, n);
  const std::vector<float> shifts = p["key_shifts"].values.read(queue);
  ASSERT_EQ(shifts.size(), 9 * n);
  for (size_t k = 0; k < 3; ++k)
    for (size_t i = 0; i < n; ++i)
      for (size_t c = 0; c < 3; ++c)
        EXPECT_EQ(shifts[(k * n + i) * 3 + c],
                  float(before.at("key_shifts")[(k * 4 + source[i]) * 3 + c]));
  // Two children in one place look like the parent: 1 - o = (1 - o')^2.
  const auto shown = [](float logit) { return 1 / (1 + std::exp(-double(logit))); };
  const std::vector<float> logits = p["logit_opacities"].values.read(queue);
  EXPECT_EQ(logits[0], 1);
  for (size_t i = 1; i < n; ++i) EXPECT_NEAR(std::pow(1 - shown(logits[i]), 2), 1 - shown(1), 1e-6);
}

}  // namespace
}  // namespace gflow
