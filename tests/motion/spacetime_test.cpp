// SPDX-License-Identifier: Apache-2.0
// A moving Gaussian: against the equivalent 4D Gaussian for linear motion, its derivative against
// central differences, the device against the double formulas, and the result of a split.
#include "optim/motion/spacetime.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "optim/reference/device_scene.hpp"
#include "optim/reference/spacetime.hpp"
#include "tests/support/compare.hpp"
#include "tests/support/device.hpp"
#include "tests/support/eigen_maths.hpp"
#include "tests/support/numbers.hpp"

namespace gflow {
namespace {

Spacetime random_spacetime(Random& random) {
  Spacetime g;
  g.mean = random.three();
  g.mean_t = random();
  g.velocity = random.three();
  g.half_acceleration = random.three();
  g.quat = random.four();
  g.turn = random.four() * .3;
  g.log_scales = random.four();
  g.logit_opacity = 3 * random();
  return g;
}

TEST(Spacetime, StraightAndNotTurningItIsTheFourDimensionalGaussianWithThatCutAndVelocity) {
  Random random(1);
  for (int i = 0; i < 30; ++i) {
    Spacetime g = random_spacetime(random);
    g.half_acceleration = {0, 0, 0};
    g.turn = {0, 0, 0, 0};
    const double t = random(), life = std::exp(g.log_scales.w), tau = t - g.mean_t;
    const SpacetimeSlice cut = spacetime_at(g, t);
    // The 4x4 covariance with conditional covariance L L^T, temporal variance s^2 and velocity v.
    const Eigen::Matrix3d l = eigen(cut.factor);
    const Eigen::Vector3d v = eigen(g.velocity);
    Eigen::Matrix4d s;
    s.topLeftCorner<3, 3>() = l * l.transpose() + life * life * v * v.transpose();
    s.topRightCorner<3, 1>() = life * life * v;
    s.bottomLeftCorner<1, 3>() = life * life * v.transpose();
    s(3, 3) = life * life;
    const Eigen::Vector3d st = s.topRightCorner<3, 1>();
    EXPECT_LT((eigen(cut.mean) - (eigen(g.mean) + st * tau / s(3, 3))).norm(), 1e-12);
    EXPECT_LT((s.topLeftCorner<3, 3>() - st * st.transpose() / s(3, 3) - l * l.transpose()).norm(),
              1e-12 * s.norm());
    EXPECT_NEAR(cut.life.opacity,
                std::exp(-.5 * tau * tau / s(3, 3)) / (1 + std::exp(-g.logit_opacity)), 1e-13);
  }
}

TEST(Spacetime, TheVelocityIsTheDerivativeOfThePathAndTheTurnKeepsTheShape) {
  Random random(2);
  const Spacetime g = random_spacetime(random);
  const double t = g.mean_t + .4, h = 1e-4;
  const Eigen::Vector3d expected =
      (eigen(spacetime_at(g, t + h).mean) - eigen(spacetime_at(g, t - h).mean)) / (2 * h);
  EXPECT_LT((eigen(spacetime_velocity(g, .4)) - expected).norm(), 1e-9);
  const Eigen::Matrix3d a = eigen(spacetime_at(g, g.mean_t).factor);
  const Eigen::Matrix3d b = eigen(spacetime_at(g, t).factor);
  EXPECT_LT((a.transpose() * a - b.transpose() * b).norm(), 1e-12);  // equal lengths of the axes
  EXPECT_GT((a - b).norm(), 1e-2);                                   // rotated
}

TEST(Spacetime, GradientEqualsCentralDifferences) {
  Random random(3);
  for (int i = 0; i < 30; ++i) {
    const Spacetime g = random_spacetime(random);
    const double t = g.mean_t + .5 * random(), v_opacity = random();
    const real3 v_mean = random.three();
    const Mat3 v_l = random.nine();
    const auto loss = [&](const std::vector<double>& x) {
      const SpacetimeSlice o = spacetime_at(reference::spacetime_from(x), t);
      return dot(o.mean, v_mean) + o.life.opacity * v_opacity + dot(o.factor.r1, v_l.r1) +
             dot(o.factor.r2, v_l.r2) + dot(o.factor.r3, v_l.r3);
    };
    const std::vector<double> expected = numeric_gradient(loss, reference::flat(g));
    EXPECT_TRUE(all_close(reference::flat(spacetime_vjp(g, t, v_mean, v_l, v_opacity)), expected,
                          {1e-6, 1e-6 * largest(expected)}));
  }
}

// ---- on the device

constexpr size_t N_SPACETIME = 37;

struct SpacetimeModel {
  Parameters p;
  std::vector<Spacetime> rows;
};
SpacetimeModel random_model(Queue& queue, const SpacetimeMotion& motion) {
  SpacetimeModel m{Parameters(queue, N_SPACETIME, motion.groups()), {}};
  Random random(5);
  for (size_t i = 0; i < N_SPACETIME; ++i) {
    m.rows.push_back(random_spacetime(random));
    // As stored on the device.
    std::vector<double> x = reference::flat(m.rows.back());
    for (double& value : x) value = float(value);
    m.rows.back() = reference::spacetime_from(x);
  }
  for (const auto& [name, values] : reference::spacetime_groups(m.rows))
    m.p[name].values.write(queue, to_float(values));
  m.p.rows.seen.fill(queue, 0);
  return m;
}

TEST(Spacetime, DeviceCutsAsTheDoubleFormulas) {
  Queue queue = test_queue();
  SpacetimeMotion motion(queue, .5f);
  SpacetimeModel m = random_model(queue, motion);
  GaussiansAt windowed, whole;
  const Buffer<cl_uint> all(queue, std::vector<cl_uint>(N_SPACETIME, 1u), "seen");
  motion.at(queue, m.p, .25f, nullptr, windowed);
  motion.at(queue, m.p, .25f, &all, whole);
  std::vector<double> means, factors, opacities;
  for (const Spacetime& g : m.rows) {
    const SpacetimeSlice s = spacetime_at(g, .25);
    for (double x : {s.mean.x, s.mean.y, s.mean.z}) means.push_back(x);
    for (real3 r : {s.factor.r1, s.factor.r2, s.factor.r3})
      for (double x : {r.x, r.y, r.z}) factors.push_back(x);
    opacities.push_back(s.life.marginal > .5 ? s.life.opacity : 0);
  }
  EXPECT_TRUE(all_close(whole.means.read(queue), means, FLOAT_MATHS));
  EXPECT_TRUE(all_close(whole.factors.read(queue), factors, FLOAT_MATHS));
  EXPECT_TRUE(all_close(windowed.opacities.read(queue), opacities, FLOAT_MATHS));
  const auto cut = std::count(opacities.begin(), opacities.end(), 0.0);
  EXPECT_GT(cut, 0);
  EXPECT_LT(cut, std::ptrdiff_t(N_SPACETIME));
}

TEST(Spacetime, DeviceGradientOfTwoTimesIsTheSumForWhatWasSeenAndUntouchedElsewhere) {
  Queue queue = test_queue();
  SpacetimeMotion motion(queue, .05f);
  SpacetimeModel m = random_model(queue, motion);
  Random random(6);
  reference::Named v;  // gradients of the Gaussians at two times
  std::vector<cl_uint> touched;
  for (size_t i = 0; i < N_SPACETIME; ++i) {
    for (int k = 0; k < 3; ++k) append(v, "mean1", {random()}), append(v, "mean2", {random()});
    for (int k = 0; k < 9; ++k) append(v, "factor1", {random()}), append(v, "factor2", {random()});
    append(v, "opacity", {random()});
    touched.push_back(i % 3 ? 4 : 0);
  }
  std::vector<Spacetime> rows;  // expected gradients
  for (size_t i = 0; i < N_SPACETIME; ++i) {
    const std::vector<double> at1 =
        reference::flat(spacetime_vjp(m.rows[i], .25, reference::row3(v["mean1"], i),
                                      reference::rows9(v["factor1"], i), v["opacity"][i]));
    std::vector<double> sum = reference::flat(spacetime_vjp(
        m.rows[i], .375, reference::row3(v["mean2"], i), reference::rows9(v["factor2"], i), 0));
    for (size_t k = 0; k < sum.size(); ++k) sum[k] = touched[i] ? sum[k] + at1[k] : 7;
    rows.push_back(reference::spacetime_from(sum));
  }
  for (auto& group : m.p.groups) group.grads.fill(queue, 7.f);
  const Buffer<cl_uint> tiles_touched(queue, touched, "tiles_touched");
  const auto upload = [&](const char* name) {
    return Buffer<float>(queue, to_float(v[name]), name);
  };
  const Buffer<float> opacity = upload("opacity");
  motion.backward(queue, m.p, .25f, true, tiles_touched, upload("mean1"), upload("factor1"),
                  opacity);
  motion.backward(queue, m.p, .375f, false, tiles_touched, upload("mean2"), upload("factor2"),
                  opacity);
  for (const auto& [name, expected] : reference::spacetime_groups(rows))
    EXPECT_LT(relative_l2(m.p[name].grads.read(queue), expected), 1e-5) << name;
  const std::vector<cl_uint> seen = m.p.rows.seen.read(queue);
  for (size_t i = 0; i < N_SPACETIME; ++i) EXPECT_EQ(seen[i], touched[i] ? 1u : 0u);
}

TEST(Spacetime, SplitInTimeLeavesTwoOnTheParentsPathWithItsVelocityAndTurn) {
  Queue queue = test_queue();
  SpacetimeMotion motion(queue, .05f);
  Random random(7);
  Spacetime parent = random_spacetime(random);
  parent.mean_t = .5;
  parent.log_scales = {std::log(.05), std::log(.04), std::log(.03), std::log(.2)};
  Parameters p(queue, 2, motion.groups());
  for (const auto& [name, values] : reference::spacetime_groups({parent, parent}))
    p[name].values.write(queue, to_float(values));
  SplitRule rule;
  rule.split_scale = .01f;
  motion.split(queue, p, Buffer<cl_uint>(queue, std::vector<cl_uint>{1, 2}, "child"), rule, 1);
  const auto read = [&](const char* name) { return p[name].values.read(queue); };
  const std::vector<float> means = read("means"), means_t = read("means_t");
  const std::vector<float> velocities = read("velocities"), quats = read("quats");
  EXPECT_NEAR(means_t[0], .4, 1e-6);
  EXPECT_NEAR(means_t[1], .6, 1e-6);
  for (size_t i = 0; i < 2; ++i) {
    const double tau = double(means_t[i]) - .5;
    const real3 mean = spacetime_at(parent, .5 + tau).mean, v = spacetime_velocity(parent, tau);
    const real4 q = parent.quat + parent.turn * tau;
    const auto row = [&](const std::vector<float>& values, size_t width) {
      return std::vector<float>(&values[width * i], &values[width * i] + width);
    };
    using Expected = std::vector<double>;
    EXPECT_TRUE(all_close(row(means, 3), Expected{mean.x, mean.y, mean.z}, FLOAT_MATHS));
    EXPECT_TRUE(all_close(row(velocities, 3), Expected{v.x, v.y, v.z}, FLOAT_MATHS));
    EXPECT_TRUE(all_close(row(quats, 4), Expected{q.x, q.y, q.z, q.w}, FLOAT_MATHS));
    EXPECT_NEAR(read("log_scales")[4 * i + 3], std::log(.12), 1e-6);
  }
}

TEST(Spacetime, PaceAndReachFollowTheLife) {
  Queue queue = test_queue();
  SpacetimeMotion motion(queue, .05f);
  Parameters p(queue, 3, motion.groups());
  std::vector<float> log_scales(12, 0.f);
  const double lives[] = {.01, .5, 30};
  for (size_t i = 0; i < 3; ++i) log_scales[4 * i + 3] = float(std::log(lives[i]));
  p["log_scales"].values.write(queue, log_scales);
  motion.set_rate_scales(queue, p, {10, .5f, 1, 8});
  EXPECT_TRUE(
      all_close(p.rows.rate_scale.read(queue), std::vector<double>{8, 10 / 2.45, 1}, FLOAT_MATHS));
  EXPECT_TRUE(
      all_close(p.rows.rate_divisor.read(queue), std::vector<double>{.5, .5, 10}, FLOAT_MATHS));
}

}  // namespace
}  // namespace gflow
