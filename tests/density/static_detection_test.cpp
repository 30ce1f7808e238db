// SPDX-License-Identifier: Apache-2.0
#include "optim/density/static_detection.hpp"

#include "optim/density/adc.hpp"
#include "optim/density/mcmc.hpp"
#include "shared/static_detection.h"
#include "tests/support/density_rule.hpp"
#include "tests/support/device.hpp"
#include "tests/support/motion_check.hpp"

namespace gflow {
namespace {

constexpr size_t kGaussians = 21;

// Every third Gaussian is dynamic.
bool moves_in_test(size_t i) { return i % 3 == 0; }

MotionShape static_shape(MotionModelKind kind) {
  MotionShape shape;
  shape.motion = kind;
  shape.hexplane.times = 16;
  shape.duration = 2;
  shape.keys = 4;
  shape.bases = 3;
  return shape;
}

ViewRows all_rows_of(Queue& queue, const Parameters& p) {
  ViewRows rows(queue);
  rows.take_all(p);
  return rows;
}

// Random Gaussians of which two thirds have no motion, in two copies: one in which all are dynamic,
// some at zero speed, and one in which these are static.
class TwoCopies {
 public:
  explicit TwoCopies(const MotionShape& shape)
      : queue(test_queue()),
        all(queue, shape, kGaussians, {}),
        split(queue, shape, kGaussians, {}) {
    for (MotionCheck* copy : {&all, &split}) {
      Parameters& p = copy->parameters();
      for (size_t g = 0; g < p.groups.size(); ++g)
        if (p.specs[g].moving) stop(p, p.specs[g], p.groups[g], 1);
      for (size_t t = 0; t < p.more.size(); ++t)
        if (p.more_specs[t].keys)
          for (size_t g = 0; g < p.more[t].groups.size(); ++g)
            stop(p, p.more[t].specs[g], p.more[t].groups[g], p.more_specs[t].keys);
      for (Table* table : p.tables())
        for (ParameterGroup& group : table->groups) {
          std::vector<float> own(group.values.size());
          for (size_t k = 0; k < own.size(); ++k) own[k] = float(1 + k);
          group.remember(queue);
          group.exp_avg.write(queue, own);
          group.exp_avg_sq.write(queue, own);
        }
      std::vector<cl_uint> steps(kGaussians);
      for (size_t i = 0; i < kGaussians; ++i) steps[i] = cl_uint(100 + i);
      p.rows.steps.write(queue, steps);
    }
    std::vector<cl_uint> moves;
    for (size_t i = 0; i < kGaussians; ++i) moves.push_back(moves_in_test(i));
    order = move(split.parameters(), moves);
  }

  // Partitions the rows by these flags; returns the previous position of each row.
  std::vector<cl_uint> move(Parameters& p, const std::vector<cl_uint>& moves) {
    std::vector<cl_uint> identity(p.count);
    for (size_t i = 0; i < p.count; ++i) identity[i] = cl_uint(i);
    Buffer<cl_uint> source(queue, identity, "source");
    Buffer<cl_uint> child(queue, std::vector<cl_uint>(p.count, 0u), "child");
    rows.move(queue, p, p.count, Buffer<cl_uint>(queue, moves, "moves"), source, child);
    return source.read(queue);
  }

  Queue queue;
  MotionCheck all, split;
  RowMover rows{queue};
  std::vector<cl_uint> order;  // row j of `split` is row order[j] of `all`

 private:
  void stop(const Parameters& p, const GroupSpec& spec, ParameterGroup& group, size_t keys) {
    std::vector<float> values = group.values.read(queue);
    const std::vector<float> static_source = spec.static_source.empty()
                                                 ? std::vector<float>{}
                                                 : p[spec.static_source].values.read(queue);
    for (size_t k = 0; k < keys; ++k)
      for (size_t i = 0; i < kGaussians; ++i)
        for (size_t c = 0; c < spec.width && !moves_in_test(i); ++c)
          values[(k * kGaussians + i) * spec.width + c] = static_source.empty()
                                                              ? (spec.static_value < 0 ? -200 : 0)
                                                              : static_source[i * spec.width + c];
    group.values.write(queue, values);
  }
};

// The rows of `all` in the order of the other copy.
template <class T>
std::vector<T> ordered(const std::vector<T>& all, const std::vector<cl_uint>& order, size_t rows,
                       size_t width) {
  std::vector<T> out(rows * width);
  for (size_t k = 0; k < out.size(); ++k) out[k] = all[order[k / width] * width + k % width];
  return out;
}

class StaticRows : public testing::TestWithParam<MotionModelKind> {};
INSTANTIATE_TEST_SUITE_P(Motion, StaticRows,
                         testing::Values(MotionModelKind::spacetime, MotionModelKind::native4d,
                                         MotionModelKind::keyframes, MotionModelKind::bases),
                         [](const auto& info) { return std::string(name_of(info.param)); });

TEST_P(StaticRows, StaticGaussiansAreShownAsThoseThatMoveAtNoSpeed) {
  TwoCopies made(static_shape(GetParam()));
  ASSERT_EQ(made.split.parameters().moving, 7u);
  const Buffer<cl_uint> seen(made.queue, std::vector<cl_uint>(kGaussians, 1u), "seen");
  for (const float t : {0.f, 0.7f, 2.f}) {
    GaussiansAt all, split;
    // Opacities are compared at the rendered time, poses of all also at a second time.
    made.all.motion().at(made.queue, made.all.parameters(), t, nullptr, all);
    made.split.motion().at(made.queue, made.split.parameters(), t, nullptr, split);
    made.all.motion().at(made.queue, made.all.parameters(), t, &seen, all);
    made.split.motion().at(made.queue, made.split.parameters(), t, &seen, split);
    const auto expect_same = [&](const Buffer<float>& a, const Buffer<float>& b, size_t width) {
      EXPECT_EQ(ordered(a.read(made.queue), made.order, kGaussians, width), b.read(made.queue))
          << t;
    };
    expect_same(all.means, split.means, 3);
    expect_same(all.factors, split.factors, 9);
    expect_same(all.opacities, split.opacities, 1);
  }
}

// native4d has two quaternions, and one for static Gaussians: their gradients add up. Gradients of
// a basis are sums over Gaussians in different orders.
TEST_P(StaticRows, GradientsAreThoseOfNoSpeed) {
  TwoCopies made(static_shape(GetParam()));
  Queue& queue = made.queue;
  Random random(3);
  const auto numbers = [&](size_t width) {
    std::vector<float> values(width * kGaussians);
    for (float& x : values) x = float(random());
    return values;
  };
  const std::vector<float> v_means = numbers(3), v_factors = numbers(9), v_opacities = numbers(1);
  std::vector<cl_uint> touched;
  for (size_t i = 0; i < kGaussians; ++i) touched.push_back(i % 5 != 4);
  const auto backward = [&](MotionCheck& copy, const std::vector<cl_uint>& order) {
    const Buffer<cl_uint> tiles(queue, ordered(touched, order, kGaussians, 1), "tiles");
    const Buffer<float> m(queue, ordered(v_means, order, kGaussians, 3), "v_means");
    const Buffer<float> f(queue, ordered(v_factors, order, kGaussians, 9), "v_factors");
    const Buffer<float> o(queue, ordered(v_opacities, order, kGaussians, 1), "v_opacities");
    copy.motion().backward(queue, copy.parameters(), 0.4f, true, tiles, m, f, o);
    copy.motion().backward(queue, copy.parameters(), 0.9f, false, tiles, m, f, o);
  };
  std::vector<cl_uint> identity(kGaussians);
  for (size_t i = 0; i < kGaussians; ++i) identity[i] = cl_uint(i);
  backward(made.all, identity);
  backward(made.split, made.order);
  const Parameters& all = made.all.parameters();
  const Parameters& split = made.split.parameters();
  const std::vector<cl_uint> seen = split.rows.seen.read(queue);
  EXPECT_EQ(ordered(all.rows.seen.read(queue), made.order, kGaussians, 1), seen);
  for (size_t g = 0; g < all.groups.size(); ++g) {
    const GroupSpec& spec = all.specs[g];
    std::vector<float> values = all.groups[g].grads.read(queue);
    if (spec.name == "quats" && all.find("quats_r")) {
      const std::vector<float> other = all["quats_r"].grads.read(queue);
      for (size_t k = 0; k < values.size(); ++k)
        if (!moves_in_test(k / 4)) values[k] += other[k];
    }
    const size_t rows = split.rows_of(spec);
    ASSERT_EQ(split.groups[g].grads.size(), rows * spec.width);
    EXPECT_TRUE(all_close(split.groups[g].grads.read(queue),
                          ordered(values, made.order, rows, spec.width), {1e-5, 1e-5}))
        << spec.name;
  }
  for (size_t t = 0; t < all.more.size(); ++t)
    for (size_t g = 0; g < all.more[t].groups.size(); ++g) {
      const GroupSpec& spec = all.more[t].specs[g];
      std::vector<float> expected = all.more[t].groups[g].grads.read(queue);
      if (const size_t keys = all.more_specs[t].keys) {
        std::vector<float> of_movers;
        for (size_t k = 0; k < keys; ++k) {
          const auto from = expected.begin() + long(k * kGaussians * spec.width);
          const auto part = ordered(std::vector<float>(from, from + long(kGaussians * spec.width)),
                                    made.order, split.moving, spec.width);
          of_movers.insert(of_movers.end(), part.begin(), part.end());
        }
        expected = of_movers;
      }
      EXPECT_TRUE(all_close(split.more[t].groups[g].grads.read(queue), expected, {1e-5, 1e-5}))
          << spec.name;
    }
}

TEST_P(StaticRows, AllButTheMotionOfStaticOnesSurvivesThereAndBack) {
  TwoCopies made(static_shape(GetParam()));
  Queue& queue = made.queue;
  Parameters& p = made.split.parameters();
  // First every other row changes between static and dynamic, then all rows become dynamic.
  std::vector<cl_uint> some;
  for (size_t j = 0; j < kGaussians; ++j) some.push_back(j % 2);
  const std::vector<cl_uint> there = made.move(p, some);
  ASSERT_EQ(p.moving, kGaussians / 2);
  const std::vector<cl_uint> back =
      ordered(there, made.move(p, std::vector<cl_uint>(kGaussians, 1u)), kGaussians, 1);
  ASSERT_EQ(p.moving, kGaussians);
  const std::vector<cl_uint> order = ordered(made.order, back, kGaussians, 1);
  const auto always_moved = [&](size_t j) { return back[j] < 7 && some[back[j]]; };
  const Parameters& all = made.all.parameters();
  EXPECT_EQ(ordered(all.rows.steps.read(queue), order, kGaussians, 1), p.rows.steps.read(queue));
  const auto expect_same = [&](const GroupSpec& spec, const Buffer<float>& before,
                               const Buffer<float>& after, size_t keys, bool own, bool moments) {
    const std::vector<float> a = before.read(queue), b = after.read(queue);
    ASSERT_EQ(a.size(), b.size());
    const std::vector<float> static_source = spec.static_source.empty()
                                                 ? std::vector<float>{}
                                                 : all[spec.static_source].values.read(queue);
    for (size_t k = 0; k < keys; ++k)
      for (size_t j = 0; j < kGaussians; ++j)
        for (size_t c = 0; c < spec.width; ++c) {
          const size_t at = (k * kGaussians + j) * spec.width + c;
          float expected = a[(k * kGaussians + order[j]) * spec.width + c];
          if (own && !always_moved(j)) {
            expected = spec.static_value;
            if (!static_source.empty()) expected = static_source[order[j] * spec.width + c];
            if (moments) expected = 0;
          }
          EXPECT_EQ(b[at], expected) << spec.name << " " << j;
        }
  };
  for (size_t t = 0; t < all.tables().size(); ++t) {
    const Table& from = *all.tables()[t];
    const Table& to = *std::as_const(p).tables()[t];
    const size_t keys = t ? all.more_specs[t - 1].keys : 1;
    for (size_t g = 0; g < from.groups.size() && keys; ++g) {
      const GroupSpec& spec = from.specs[g];
      const bool own = spec.moving || t > 0;
      expect_same(spec, from.groups[g].values, to.groups[g].values, keys, own, false);
      expect_same(spec, from.groups[g].exp_avg, to.groups[g].exp_avg, keys, own, true);
      expect_same(spec, from.groups[g].exp_avg_sq, to.groups[g].exp_avg_sq, keys, own, true);
    }
  }
}

// Gaussians of scales 0.1, 0.2 and 0.3 in a video of length 1, with constant speed along x and
// constant rotation about z. They always exist unless `life` is set.
struct MadeStatic {
  float speed = 0, turn = 0;
  float life = 1000;
  cl_uint steps = 1000;
};

class StaticSpacetime {
 public:
  explicit StaticSpacetime(const std::vector<MadeStatic>& made)
      : queue(test_queue()),
        motion(make_motion(queue, MotionShape{})),
        p(queue, made.size(), motion->groups()) {
    for (ParameterGroup& group : p.groups) group.values.fill(queue, 0);
    std::vector<float> means, means_t, velocities, quats, turns, log_scales;
    std::vector<cl_uint> steps;
    for (const MadeStatic& m : made) {
      means.insert(means.end(), {float(steps.size()), 0, 0});
      velocities.insert(velocities.end(), {m.speed, 0, 0});
      quats.insert(quats.end(), {2, 0, 0, 0});
      turns.insert(turns.end(), {0, 0, 0, m.turn});  // half the angle, at length 2: the angle
      log_scales.insert(log_scales.end(),
                        {std::log(0.1f), std::log(0.2f), std::log(0.3f), std::log(m.life)});
      means_t.push_back(0.3f);
      steps.push_back(m.steps);
    }
    p["means"].values.write(queue, means);
    p["means_t"].values.write(queue, means_t);
    p["velocities"].values.write(queue, velocities);
    p["quats"].values.write(queue, quats);
    p["turns"].values.write(queue, turns);
    p["log_scales"].values.write(queue, log_scales);
    p.rows.steps.write(queue, steps);
    rule.moments = 11;
    rule.most = 0.1f;
  }
  std::vector<cl_uint> refine() { return detection.refine(queue, p, *motion, rule).read(queue); }
  std::vector<float> values(const char* name) { return p[name].values.read(queue); }

  // A view at t with gradients gradients[i] along x for row i; all static rows are seen.
  void see(float t, const std::vector<float>& gradients) {
    std::vector<float> v(3 * gradients.size());
    for (size_t i = 0; i < gradients.size(); ++i) v[3 * i] = gradients[i];
    const Buffer<cl_uint> touched(queue, std::vector<cl_uint>(p.count, 1u), "tiles");
    const Buffer<float> v_means(queue, v, "v_means");
    detection.see(queue, p, all_rows_of(queue, p), touched, t, v_means, nullptr, v_means, false);
  }

  Queue queue;
  std::unique_ptr<Motion> motion;
  Parameters p;
  StaticDetection detection{queue};
  StaticRule rule;
};

// Half of the path and of the rotation are on each side of the mean pose; the limit is 0.1 standard
// deviations: 0.01 along x. A rotation by a about z moves the ends of axes s and s' by a s and a
// s': a sqrt((s/s')^2 + (s'/s)^2) = a sqrt(4.25).
TEST(StaticDetection, WhatTravelsAndTurnsLittleBecomesStatic) {
  StaticSpacetime made({{0.019f},
                        {0.021f},
                        {0},
                        {0, 0.096f},
                        {0, 0.098f},
                        {0.012f, 0.05f},
                        {0, 0, 1000, 49},
                        {0, 0, 0.01f},
                        {NAN}});
  EXPECT_EQ(made.refine(), (std::vector<cl_uint>{1, 4, 5, 6, 7, 8, 0, 2, 3}));
  EXPECT_EQ(made.p.moving, 6u);
  EXPECT_EQ(made.values("velocities").size(), 18u);
}

TEST(StaticDetection, AStaticGaussianIsWhereItWasOnAverage) {
  StaticSpacetime made({{5}, {0.01f, 0.04f}});
  made.refine();
  const std::vector<float> means = made.values("means"), quats = made.values("quats");
  EXPECT_NEAR(means[0], 0, 1e-6);
  EXPECT_NEAR(means[3], 1 + 0.2 * 0.01, 1e-6);                // 0.2 after its temporal mean
  EXPECT_NEAR(quats[4], 2 * std::cos(0.2 * 0.04 / 2), 1e-5);  // the length is unchanged
  EXPECT_NEAR(quats[7], 2 * std::sin(0.2 * 0.04 / 2), 1e-5);
}

// The bound of kernels/shared/static_detection.h, at random positions around random Gaussians.
TEST(StaticDetection, NoPlaceChangesByMoreThanTheBound) {
  Random random(5);
  const auto draw = [&] { return make_real3(random(), random(), random()); };
  double largest = 0;
  for (int i = 0; i < 20000; ++i) {
    const real4 q = make_real4(1 + random(), random(), random(), random());
    const real4 turned = q + make_real4(random(), random(), random(), random()) * 0.02;
    const real3 scales = make_real3(0.5 + 0.1 * i / 20000.0, 1, 1.5), mean = draw() * 0.02;
    const real3 static_mean = make_real3(0, 0, 0);
    const Mat3 l1 = factor_of(turned, scales);
    const auto density = [&](real4 quat, real3 x) {
      const real3 y = mat3_transpose_mul_vec(quat_to_rotmat(quat_normalize(quat).q), x);
      const real3 z = make_real3(y.x / scales.x, y.y / scales.y, y.z / scales.z);
      return std::exp(-0.5 * dot(z, z));
    };
    const real3 x = draw();
    const double change = std::fabs(density(turned, x - mean) - density(q, x - static_mean));
    const double d = distance_from_static(static_mean, q, scales, mean, l1);
    EXPECT_LE(change, 0.74 * d * (1 + d));
    largest = std::max(largest, change / d);
  }
  EXPECT_GT(largest, 0.4);  // the bound is not trivial
}

TEST(StaticDetection, GradientsThatAddUpMakeAStaticGaussianMoveAgain) {
  StaticSpacetime made({{5}, {0}, {0}, {0}});
  made.rule.wake = 4;
  made.refine();
  ASSERT_EQ(made.p.moving, 1u);
  for (const char* name : {"means", "velocities"}) {
    made.p[name].remember(made.queue);
    made.p[name].exp_avg.fill(made.queue, 1.f);
  }
  // Row 1 has positive gradients after its temporal mean and negative ones before: sqrt(20) times
  // the expected noise. Row 2 has the opposite sign in three views of 20: sqrt(20) 14/20 = 3.1
  // times. Row 3 has none.
  for (int k = 0; k < 20; ++k) {
    const float gradient = k % 2 ? -1.f : 1.f;
    made.see(k % 2 ? 0.1f : 0.5f, {1, gradient, k < 3 ? -gradient : gradient, 0});
  }
  EXPECT_EQ(made.refine(), (std::vector<cl_uint>{0, 1, 2, 3}));
  ASSERT_EQ(made.p.moving, 2u);
  EXPECT_EQ(made.values("velocities"), (std::vector<float>{5, 0, 0, 0, 0, 0}));
  EXPECT_EQ(made.p["velocities"].exp_avg.read(made.queue), (std::vector<float>{1, 1, 1, 0, 0, 0}));
  EXPECT_EQ(made.p["means"].exp_avg.read(made.queue),
            (std::vector<float>{1, 1, 1, 0, 0, 0, 1, 1, 1, 1, 1, 1}));
  EXPECT_EQ(made.p.rows.steps.read(made.queue), (std::vector<cl_uint>{1000, 0, 1000, 1000}));
  // The accumulated gradient is reset, and row 1 is dynamic on trial.
  EXPECT_EQ(made.refine(), (std::vector<cl_uint>{0, 1, 2, 3}));
  EXPECT_EQ(made.p.moving, 2u);
}

// The gradient of flow for static Gaussians is part of v_means, or separate.
TEST(StaticDetection, FlowHasTheSameGradientToldInBothWays) {
  const auto gradients = [](float v_mean, float v_mean_t2, bool stood_still) {
    StaticSpacetime made(std::vector<MadeStatic>(1));
    made.refine();
    const Buffer<cl_uint> touched(made.queue, {1}, "tiles");
    const Buffer<float> v(made.queue, {v_mean, 0, 0}, "v"),
        v_t2(made.queue, {v_mean_t2, 0, 0}, "v");
    const float t2 = 0.7f;
    made.detection.see(made.queue, made.p, all_rows_of(made.queue, made.p), touched, 0.5f, v, &t2,
                       v_t2, stood_still);
    Arrays arrays;
    made.detection.save_state(made.queue, made.p, arrays);
    return std::get<std::vector<float>>(arrays.at("rest/pulls").values);
  };
  const std::vector<float> within = gradients(3 - 2, 2, false), beside = gradients(3, 2, true);
  EXPECT_FLOAT_EQ(within[0], 3 * (0.5f - 0.3f) + 2 * (0.7f - 0.5f));  // its temporal mean is 0.3
  EXPECT_FLOAT_EQ(beside[0], within[0]);
  EXPECT_FLOAT_EQ(beside[3], within[3]);
}

TEST(StaticDetection, NothingMovesAgainWhereThatIsOff) {
  StaticSpacetime made(std::vector<MadeStatic>(1));
  made.rule.wake = 0;
  made.refine();
  for (int k = 0; k < 20; ++k) made.see(1, {1});
  made.refine();
  EXPECT_EQ(made.p.moving, 0u);
}

TEST(StaticDetection, EvidenceOfDensityControlGoesWithItsRows) {
  StaticSpacetime made({{0}, {5}, {0}});
  AdcDensity density(made.queue);
  const Buffer<cl_uint> touched(made.queue, {1, 1, 1}, "tiles");
  const Buffer<float> v(made.queue, {1, 0, 2, 0, 3, 0}, "v_means2d");
  density.see(made.queue, made.p, {2, 2, {}, touched, v});
  const Buffer<cl_uint> fewer(made.queue, {0, 1, 1}, "tiles");
  density.see(made.queue, made.p, {2, 2, {}, fewer, v});
  const auto evidence = [&](const char* name) {
    Arrays arrays;
    density.save_state(made.queue, arrays);
    return std::get<std::vector<float>>(arrays.at(name).values);
  };
  EXPECT_EQ(evidence("density/pull"), (std::vector<float>{1, 4, 6}));
  EXPECT_EQ(evidence("density/views"), (std::vector<float>{1, 2, 2}));
  density.reorder(made.queue, made.detection.refine(made.queue, made.p, *made.motion, made.rule));
  EXPECT_EQ(evidence("density/pull"), (std::vector<float>{4, 1, 6}));
  EXPECT_EQ(evidence("density/views"), (std::vector<float>{2, 1, 2}));
}

// Row 0 is dynamic, rows 1 and 2 are static; the last one grows.
// One dynamic Gaussian and two static ones, of which those with a gradient v_means2d grow.
StaticSpacetime grown(const std::vector<float>& v_means2d, bool wakes) {
  StaticSpacetime made({{5}, {0}, {0}});
  made.p["logit_opacities"].values.fill(made.queue, 1);
  made.refine();
  AdcDensity density(made.queue);
  DensityRule rule = quiet_rule();
  rule.grad_threshold = 1;
  rule.prune_scale = 10;
  rule.split.split_scale = 1;
  rule.wakes = wakes;
  const Buffer<cl_uint> touched(made.queue, {1, 1, 1}, "tiles");
  const Buffer<float> v(made.queue, v_means2d, "v_means2d");
  density.see(made.queue, made.p, {2, 2, {}, touched, v});
  density.refine(made.queue, made.p, *made.motion, rule, 1);
  return made;
}

TEST(StaticDetection, WhatGrowsMoves) {
  StaticSpacetime made = grown({0, 0, 0, 0, 9, 0}, true);
  ASSERT_EQ(made.p.count, 4u);
  EXPECT_EQ(made.p.moving, 3u);
  const std::vector<float> means = made.values("means");
  EXPECT_NEAR(means[3], 2, 1e-5);  // the first child is at the position of the parent
  EXPECT_NEAR(means[9], 1, 1e-5);  // still static
  EXPECT_EQ(made.values("velocities"), (std::vector<float>{5, 0, 0, 0, 0, 0, 0, 0, 0}));
}

TEST(StaticDetection, WithoutItWhatGrowsFromAStaticGaussianIsStatic) {
  StaticSpacetime made = grown({9, 0, 0, 0, 9, 0}, false);
  ASSERT_EQ(made.p.count, 5u);
  EXPECT_EQ(made.p.moving, 2u);
  EXPECT_EQ(made.values("velocities"), (std::vector<float>{5, 0, 0, 5, 0, 0}));
}

// Row 1 is static and dead: it is relocated to another row, and rows that share a place become
// dynamic.
TEST(StaticDetection, WhatIsRelocatedMoves) {
  StaticSpacetime made({{5}, {0}, {0}});
  made.refine();
  made.p["logit_opacities"].values.write(made.queue, {-3, -20, 3});
  McmcDensity density(made.queue);
  DensityRule rule = quiet_rule();
  rule.growth = 0;
  density.refine(made.queue, made.p, *made.motion, rule, 1);
  ASSERT_EQ(made.p.count, 3u);
  EXPECT_EQ(made.p.moving, 3u);  // row 5 is no longer static: place 2 now belongs to two rows
  const std::vector<float> opacities = made.values("logit_opacities");
  EXPECT_EQ(opacities[1], opacities[2]);
}

}  // namespace
}  // namespace gflow
