// SPDX-License-Identifier: Apache-2.0
// The reference itself: its hand-written gradients against central differences of its own images,
// for every parameter, with fixed contributors. The engine's tests rely on it.
#include <gtest/gtest.h>

#include "optim/reference/scenes.hpp"
#include "tests/support/compare.hpp"

namespace gflow {
namespace {

using reference::Contributors;
using reference::Gaussians;
using reference::Named;
using reference::Planes;
using reference::Rendering;

// Every gradient in `actual` equals the central difference of `loss` to 1e-6 of the maximum of its
// class (steps of 1e-6: rounding is 1e-10 of the loss, curvature less).
void expect_gradient(Named p, const Named& actual,
                     const std::function<double(const Named&)>& loss) {
  for (const auto& [name, gradient] : actual) {
    Named moved = p;
    const std::vector<double> expected = numeric_gradient(
        [&, key = name](const std::vector<double>& x) {
          moved[key] = x;
          return loss(moved);
        },
        p[name]);
    EXPECT_GT(largest(expected), 0) << name;
    EXPECT_TRUE(all_close(gradient, expected, {1e-6, 1e-6 * largest(expected)})) << name;
  }
}

// Small, deep and opaque, so that the cut at 0.99 and the stop both occur, and wide, so that some
// projections are clamped at the field-of-view margin.
PosedScene hard_scene() {
  SceneSpec spec;
  spec.n = 12;
  spec.width = 11;
  spec.height = 9;
  spec.cover = 14;
  spec.spread = 1.6;
  spec.opaque = .4;
  spec.seed = 3;
  return random_scene(spec);
}

TEST(Reference, SceneForTheGradientMeetsEveryCase) {
  PosedScene s = hard_scene();
  const Gaussians g = reference::posed(s.p);
  const Rendering r = reference::render(s.shot, g);
  size_t clamped = 0, held = 0, stopped = 0;
  for (const auto& c : r.contributors.list) clamped += c.clamped;
  for (const auto& seen : r.seen) held += !seen.p.u_inside || !seen.p.v_inside;
  for (double a : r.images.alpha) stopped += a > 1 - 1e-4;
  EXPECT_GT(clamped, 0u);
  EXPECT_GT(held, 0u);
  EXPECT_GT(stopped, 0u);
}

class ReferenceGradient : public testing::TestWithParam<std::tuple<Transport, StopRule, int>> {};

TEST_P(ReferenceGradient, EqualsCentralDifferences) {
  PosedScene s = hard_scene();
  std::tie(s.shot.settings.transport, s.shot.settings.stop, s.shot.settings.top_k) = GetParam();
  const Rendering r = reference::render(s.shot, reference::posed(s.p));
  const Planes v = random_cotangents(s, 5);
  Named actual =
      reference::posed_vjp(s.p, reference::render_vjp(s.shot, reference::posed(s.p), r, v));
  if (s.shot.settings.transport == Transport::translate) {  // shapes at t2 have no effect
    EXPECT_EQ(largest(actual["quats_t2"]), 0);
    EXPECT_EQ(largest(actual["scales_t2"]), 0);
    actual.erase("quats_t2");
    actual.erase("scales_t2");
  }
  expect_gradient(s.p, actual, [&](const Named& p) {
    return inner(reference::render(s.shot, reference::posed(p), &r.contributors).images, v);
  });
}

INSTANTIATE_TEST_SUITE_P(AllModes, ReferenceGradient,
                         testing::Combine(testing::Values(Transport::paper, Transport::ot,
                                                          Transport::material,
                                                          Transport::translate),
                                          testing::Values(StopRule::include, StopRule::exclude),
                                          testing::Values(0, 3)));

TEST(Reference, GradientOfNative4dAndSphericalHarmonicsEqualsCentralDifferences) {
  PosedScene s = hard_scene();
  const size_t n = s.count();
  std::mt19937 rng(8);
  const auto random = [&](size_t count, double size) {
    std::vector<double> v(count);
    for (double& x : v) x = size * (double(rng()) / 2147483648.0 - 1);
    return v;
  };
  Named p;
  p["means"] = s.p["means"];
  p["means_t"] = random(n, .5);
  p["quats"] = random(4 * n, 1);
  p["quats_r"] = random(4 * n, 1);
  p["log_scales"] = random(4 * n, .3);
  for (size_t i = 0; i < 4 * n; ++i) p["log_scales"][i] -= i % 4 == 3 ? .5 : 1.;
  p["logit_opacities"] = random(n, 3);
  p["sh0"] = random(3 * n, 1);
  p["sh_rest"] = random(45 * n, .3);
  const reference::Cut cut{.1, .25, 3, s.shot.camera};
  const Gaussians g = reference::native4d(p, cut);
  const Rendering r = reference::render(s.shot, g);
  const Planes v = random_cotangents(s, 6);
  expect_gradient(
      p, reference::native4d_vjp(p, cut, reference::render_vjp(s.shot, g, r, v)),
      [&](const Named& q) {
        return inner(reference::render(s.shot, reference::native4d(q, cut), &r.contributors).images,
                     v);
      });
}

TEST(Reference, DetachedFlowLeavesOnlyItsWeightsAtTheFirstTime) {
  PosedScene s = hard_scene();
  s.shot.settings.transport = Transport::paper;
  const Gaussians g = reference::posed(s.p);
  const Rendering r = reference::render(s.shot, g);
  const Planes v = only(random_cotangents(s, 5), "flow");
  s.shot.settings.detach_t1 = true;
  const Named actual = reference::posed_vjp(s.p, reference::render_vjp(s.shot, g, r, v));
  // The same loss with each Gaussian's flow field fixed: only the weights depend on p.
  const auto loss = [&](const Named& p) {
    Rendering moved = reference::render(s.shot, reference::posed(p), &r.contributors);
    for (size_t i = 0; i < moved.seen.size(); ++i) {
      const auto &was = r.seen[i], &is = moved.seen[i];
      const real2 step = is.p.mean - was.p.mean;
      moved.seen[i].d = was.d;
      moved.seen[i].m = was.m + make_real2(was.d.a * step.x + was.d.b * step.y,
                                           was.d.c * step.x + was.d.d * step.y);
    }
    return inner(reference::blend(s.shot, reference::posed(p), moved.seen, r.contributors), v);
  };
  for (const char* name : {"means", "quats", "scales", "opacities"}) {
    Named moved = s.p;
    const std::vector<double> expected = numeric_gradient(
        [&](const std::vector<double>& x) {
          moved[name] = x;
          return loss(moved);
        },
        s.p[name]);
    EXPECT_TRUE(all_close(actual.at(name), expected, {1e-6, 1e-6 * largest(expected)})) << name;
  }
}

// One round Gaussian at the centre of a pixel, computed by hand.
TEST(Reference, DrawsOneGaussianAsItsFormulaSays) {
  PosedScene s;
  s.shot.camera = s.shot.camera_t2 = test_camera(3, 1);
  s.shot.camera.fx = s.shot.camera.fy = 10;
  s.shot.camera.cx = 1.5f;
  s.shot.camera.cy = .5f;
  s.shot.camera_t2 = s.shot.camera;
  add_gaussian(s, {0, 0, 5}, {.5, .5, .5}, .5, {.5, 0, 0});
  s.shot.settings.transport = Transport::translate;
  const Rendering r = reference::render(s.shot, reference::posed(s.p));
  const double variance = 1 + double(DILATION);  // (10 / 5 x .5)^2 + dilation
  const double side = .5 * std::exp(-.5 / variance);
  EXPECT_TRUE(all_close(r.images.alpha, std::vector<double>{side, .5, side}, {1e-12, 0}));
  EXPECT_TRUE(all_close(r.images.depth, std::vector<double>{5 * side, 2.5, 5 * side}, {1e-12, 0}));
  EXPECT_TRUE(all_close(r.images.flow, std::vector<double>{1, 1, 1, 0, 0, 0}, {1e-12, 1e-12}));
}

}  // namespace
}  // namespace gflow
