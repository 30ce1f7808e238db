// SPDX-License-Identifier: Apache-2.0
// Properties of the engine that do not depend on its implementation: losses add, switches change
// nothing, a Gaussian without motion has no flow, one with motion has the right one, each path
// carries its gradient, and a broken Gaussian does not affect others.
#include "optim/engine/engine.hpp"

#include <gtest/gtest.h>

#include "optim/reference/device_scene.hpp"
#include "tests/support/compare.hpp"
#include "tests/support/device.hpp"

namespace gflow {
namespace {

const Transport TRANSPORTS[] = {Transport::paper, Transport::ot, Transport::material,
                                Transport::translate};

PosedScene small_scene(Transport transport = Transport::material) {
  SceneSpec spec;
  spec.n = 80;
  spec.width = 45;
  spec.height = 30;
  spec.seed = 9;
  PosedScene s = random_scene(spec);
  s.shot.settings.transport = transport;
  return s;
}

bool all_finite(const std::vector<float>& a) {
  for (float x : a)
    if (!std::isfinite(x)) return false;
  return true;
}

// The image gradient of one pixel at a time gives each pixel's contribution; absgrad sums their
// lengths in one pass and changes no other gradient.
TEST(Engine, AbsgradIsTheSumOfTheLengthsOfAllPixelsGradients) {
  Queue queue = test_queue();
  SceneSpec spec;
  spec.n = 30;
  spec.width = 19;  // two tiles
  spec.height = 7;
  PosedScene s = random_scene(spec);
  const Channels channels{true, false};
  DeviceScene plain(queue, s, channels);
  s.shot.settings.absgrad = true;
  DeviceScene absolute(queue, s, channels);
  plain.forward();
  absolute.forward();
  const reference::Planes all = random_cotangents(s, 1);
  const FloatArrays signed_gradients = plain.backward(all);
  EXPECT_EQ(absolute.backward(all), signed_gradients);
  const std::vector<float> got = absolute.gradients.v_means2d.read(queue);

  std::vector<double> expected(2 * spec.n);
  const size_t pixels = s.pixels();
  for (size_t pixel = 0; pixel < pixels; ++pixel) {
    reference::Planes one = all;
    for (std::vector<double>* plane : {&one.rgb, &one.alpha, &one.depth, &one.flow})
      for (size_t i = 0; i < plane->size(); ++i)
        if (i % pixels != pixel) (*plane)[i] = 0;
    plain.backward(one);
    const std::vector<float> v = plain.gradients.v_means2d.read(queue);
    for (size_t i = 0; i < spec.n; ++i) {
      const double each = std::hypot(double(v[2 * i]), double(v[2 * i + 1])) / std::sqrt(2.);
      expected[2 * i] += each;
      expected[2 * i + 1] += each;
    }
  }
  EXPECT_GT(norm(expected), 1.5 * norm(plain.gradients.v_means2d.read(queue)));
  EXPECT_LT(relative_l2(got, expected), 1e-5);  // rounding of sums of 133 positive terms
}

// A row marked as unmoved in a view behaves as with equal poses at both times, but needs no pose at
// t2. The flow gradients of its two poses sum to 0; only the mean at t2 gets a separate gradient.
TEST(Engine, WhatStandsStillNeedsNoSecondPose) {
  constexpr size_t moving = 30;
  for (Transport transport : TRANSPORTS) {
    Queue queue = test_queue();
    PosedScene s = small_scene(transport);
    s.shot.camera_t2 = s.shot.camera;
    for (const auto& [name, width] : {std::pair{"means", 3}, {"quats", 4}, {"scales", 3}})
      std::copy(s.p[name].begin() + long(moving) * width, s.p[name].end(),
                s.p[std::string(name) + "_t2"].begin() + long(moving) * width);
    DeviceScene twice(queue, s), once(queue, s);
    once.stand_still_from(moving);
    const FloatArrays expected = twice.forward(), images = once.forward();
    for (const char* name : {"rgb", "alpha", "depth"})
      EXPECT_EQ(images.at(name), expected.at(name));
    EXPECT_LT(relative_l2(images.at("flow"), expected.at("flow")), 1e-6);

    const reference::Planes v = random_cotangents(s, 1);
    const FloatArrays a = twice.backward(v), b = once.backward(v);
    for (const auto& [key, width] : {std::pair{"means", 3}, {"quats", 4}, {"scales", 3}}) {
      const std::string name = key;
      const auto moved = [&, rows = long(moving) * width](const std::vector<float>& all) {
        return std::vector<float>(all.begin(), all.begin() + rows);
      };
      const auto still = [&, rows = long(moving) * width](const std::vector<float>& all) {
        return std::vector<float>(all.begin() + rows, all.end());
      };
      EXPECT_LT(relative_l2(moved(b.at(name)), moved(a.at(name))), 1e-6) << name;
      EXPECT_LT(relative_l2(moved(b.at(name + "_t2")), moved(a.at(name + "_t2"))), 1e-6) << name;
      std::vector<float> sum = still(a.at(name)), at_t2 = still(a.at(name + "_t2"));
      for (size_t i = 0; i < sum.size(); ++i) sum[i] += at_t2[i];
      EXPECT_LT(relative_l2(still(b.at(name)), sum), 2e-5) << name;  // two parts that cancel
      if (name == "means") {
        EXPECT_GT(relative_l2(still(a.at(name)), sum), 1e-3);
      }
    }
    if (transport == Transport::translate) {  // otherwise the position changes H as well
      EXPECT_LT(relative_l2(b.at("means_t2"), a.at("means_t2")), 1e-6);
    }
  }
}

// A tile of moving Gaussians alone has their flow, a tile of unmoved ones has none; in a mixed tile
// both count.
TEST(Engine, TilesOfMoversAloneHaveTheirFlow) {
  for (const int lanes : {0, 1}) {
    Queue queue = test_queue(lanes);
    PosedScene s = random_scene({});
    s.shot.settings.transport = Transport::material;
    s.shot.camera = s.shot.camera_t2 = test_camera(45, 30);
    for (auto& [name, values] : s.p) values.clear();
    add_gaussian(s, {-.9, -.4, 3}, {.1, .1, .1}, .8, {.05, .02, 0});  // moves
    add_gaussian(s, {.1, .1, 3}, {.1, .1, .1}, .8, {.05, .02, 0});    // moves, next to the third
    add_gaussian(s, {.1, .2, 3}, {.1, .1, .1}, .8, {0, 0, 0});
    add_gaussian(s, {.9, .4, 3}, {.1, .1, .1}, .8, {0, 0, 0});
    DeviceScene twice(queue, s), once(queue, s);
    once.stand_still_from(2);
    const std::vector<float> expected = twice.forward().at("flow"),
                             flow = once.forward().at("flow");
    EXPECT_LT(relative_l2(flow, expected), 1e-6) << lanes;
    const reference::Planes v = random_cotangents(s, 1);
    std::vector<float> a = once.backward(v).at("means_t2"), b = twice.backward(v).at("means_t2");
    a.resize(6), b.resize(6);  // the moving ones
    EXPECT_LT(relative_l2(a, b), 1e-6) << lanes;
  }
}

// If no listed Gaussian moves, no tile has flow (its kernel would process all of them).
TEST(Engine, NoTileHasFlowWhereAllStandStill) {
  Queue queue = test_queue();
  PosedScene s = random_scene({});
  s.shot.camera_t2 = s.shot.camera;
  DeviceScene still(queue, s);
  still.stand_still_from(0);
  const FloatArrays images = still.forward();
  for (const float x : images.at("flow")) ASSERT_EQ(x, 0);
  ASSERT_NE(still.engine.tiles_with_flow(), nullptr);
  for (const cl_uchar tile : still.engine.tiles_with_flow()->read(queue)) ASSERT_EQ(tile, 0);
}

// Skipped work affects no pixel: images and gradients are bitwise equal with and without it.
TEST(Engine, SkipsChangeNoBit) {
  Queue queue = test_queue();
  PosedScene s = small_scene();
  for (size_t i = 0; i < s.count(); i += 3) s.p["opacities"][i] = 0.98;  // some tiles are opaque
  const reference::Planes v = random_cotangents(s, 1);
  DeviceScene shipped(queue, s);
  const FloatArrays images = shipped.forward(), gradients = shipped.backward(v);
  const size_t intersections = shipped.engine.tiles().intersections;
  const std::vector<cl_ushort> masks = shipped.engine.tiles().masks.read(queue);
  for (bool Skips::*skip : {&Skips::boxes, &Skips::masks, &Skips::saturated}) {
    s.shot.settings.skip = {};
    s.shot.settings.skip.*skip = false;
    DeviceScene without(queue, s);
    EXPECT_EQ(without.forward(), images);
    EXPECT_EQ(without.backward(v), gradients);
    const Tiles& tiles = without.engine.tiles();
    EXPECT_EQ(tiles.intersections > intersections, skip == &Skips::boxes);
    const std::vector<cl_ushort> touched = tiles.masks.read(queue);
    EXPECT_EQ(std::count(touched.begin(), touched.end(), 0xffff) == long(touched.size()),
              skip == &Skips::masks);
  }
}

TEST(Engine, GradientOfTwoLossesIsTheSumOfBoth) {  // T37
  Queue queue = test_queue();
  const PosedScene s = small_scene();
  DeviceScene device(queue, s);
  device.forward();
  reference::Planes both = random_cotangents(s, 1);
  std::fill(both.depth.begin(), both.depth.end(), 0.0);
  reference::Planes photometric = both;
  std::fill(photometric.flow.begin(), photometric.flow.end(), 0.0);
  const FloatArrays sum = device.backward(both), a = device.backward(photometric),
                    b = device.backward(only(both, "flow"));
  for (const auto& [name, values] : sum) {
    std::vector<double> expected;
    for (size_t i = 0; i < values.size(); ++i)
      expected.push_back(double(a.at(name)[i]) + double(b.at(name)[i]));
    // float32 rounds three sums of several hundred terms.
    EXPECT_LT(relative_l2(values, expected), 1e-6) << name;
    EXPECT_GT(norm(values), 0) << name;
  }
}

TEST(Engine, PhotometricGradientsHaveTheSameBitsWithoutFlow) {
  Queue queue = test_queue();
  const PosedScene s = small_scene();
  reference::Planes v = random_cotangents(s, 2);
  std::fill(v.flow.begin(), v.flow.end(), 0.0);
  DeviceScene with(queue, s), without(queue, s, {false, true});
  FloatArrays images = with.forward();
  images.erase("flow");
  EXPECT_TRUE(images == without.forward());
  const FloatArrays g = with.backward(v);
  for (const auto& [name, values] : without.backward(v)) EXPECT_TRUE(g.at(name) == values) << name;
}

TEST(Engine, WhatDoesNotMoveHasExactlyNoFlowAndAFiniteGradient) {  // T9
  Queue queue = test_queue();
  for (Transport transport : TRANSPORTS) {
    PosedScene s = small_scene(transport);
    s.shot.camera_t2 = s.shot.camera;
    for (const char* name : {"means", "quats", "scales"})
      s.p[name + std::string("_t2")] = s.p[name];
    DeviceScene device(queue, s);
    const FloatArrays images = device.forward();
    for (float f : images.at("flow")) ASSERT_EQ(f, 0.f) << int(transport);
    for (const auto& [name, values] : device.backward(random_cotangents(s, 3)))
      EXPECT_TRUE(all_finite(values)) << name << " " << int(transport);
  }
}

// A flat splat parallel to the image keeps its shape when it moves sideways: every pixel under it
// moves by f dx / z with every transport.
TEST(Engine, FlowOfAPureTranslationIsTheProjectedDisplacement) {
  Queue queue = test_queue();
  for (Transport transport : TRANSPORTS) {
    PosedScene s = random_scene({0, 40, 30});
    s.shot.camera = s.shot.camera_t2 = test_camera(40, 30);
    s.shot.settings.transport = transport;
    add_gaussian(s, {.1, -.2, 4}, {.5, .3, 0}, .8, {.25, .125, 0});
    DeviceScene device(queue, s);
    const FloatArrays images = device.forward();
    size_t drawn = 0;
    for (size_t i = 0; i < s.pixels(); ++i) {
      if (images.at("alpha")[i] == 0) continue;
      ++drawn;
      // 1e-5 px: means are pixel coordinates of about 20 px in float32.
      EXPECT_NEAR(images.at("flow")[i], 40 * .25 / 4, 1e-5);
      EXPECT_NEAR(images.at("flow")[s.pixels() + i], 44 * .125 / 4, 1e-5);
    }
    EXPECT_GT(drawn, 100u);
  }
}

// A moving camera and a static world: the same flow, by camera_t2.
TEST(Engine, FlowFollowsTheSecondCamera) {
  Queue queue = test_queue();
  PosedScene s = random_scene({0, 40, 30});
  s.shot.camera = s.shot.camera_t2 = test_camera(40, 30);
  s.shot.camera_t2.translation[0] = .25f;
  add_gaussian(s, {.1, -.2, 4}, {.5, .3, 0}, .8);
  DeviceScene device(queue, s);
  const FloatArrays images = device.forward();
  EXPECT_GT(images.at("alpha")[15 * 40 + 20], .1f);
  for (size_t i = 0; i < s.pixels(); ++i) {
    const double expected = images.at("alpha")[i] > 0 ? 40 * .25 / 4 : 0;
    EXPECT_NEAR(images.at("flow")[i], expected, 1e-5);
  }
}

TEST(Engine, FlowLossAloneReachesEveryParameterAtBothTimes) {  // T36
  Queue queue = test_queue();
  for (Transport transport : {Transport::paper, Transport::ot, Transport::material}) {
    const PosedScene s = small_scene(transport);
    DeviceScene device(queue, s);
    device.forward();
    const FloatArrays g = device.backward(only(random_cotangents(s, 4), "flow"));
    for (const char* name :
         {"means", "quats", "scales", "opacities", "means_t2", "quats_t2", "scales_t2"})
      EXPECT_GT(norm(g.at(name)), 1e-3) << name << " " << int(transport);
    EXPECT_EQ(norm(g.at("colors")), 0);
  }
}

TEST(Engine, DetachedFlowMatchesTheReference) {
  Queue queue = test_queue();
  PosedScene s = small_scene(Transport::paper);
  s.shot.settings.detach_t1 = true;
  const reference::Gaussians g = reference::posed(s.p);
  const reference::Rendering r = reference::render(s.shot, g);
  const reference::Planes v = only(random_cotangents(s, 5, r.contributors.doubtful), "flow");
  DeviceScene device(queue, s);
  device.forward();
  const FloatArrays actual = device.backward(v);
  for (const auto& [name, values] :
       reference::posed_vjp(s.p, reference::render_vjp(s.shot, g, r, v)))
    EXPECT_LE(relative_l2(actual.at(name), values), 2e-5) << name;
}

// With one Gaussian the weights cancel from the flow: the gradient at t1 is rounding only.
TEST(Engine, DetachedFlowOfOneGaussianLeavesItAloneAtTheFirstTime) {
  Queue queue = test_queue();
  PosedScene s = random_scene({0, 40, 30});
  s.shot.settings.detach_t1 = true;
  add_gaussian(s, {.1, -.2, 4}, {.5, .3, .2}, .8, {.25, .125, 0});
  s.shot.settings.transport = Transport::translate;  // gives the same flow at all its pixels
  DeviceScene device(queue, s);
  device.forward();
  const FloatArrays g = device.backward(only(random_cotangents(s, 6), "flow"));
  EXPECT_GT(norm(g.at("means_t2")), .1);
  EXPECT_LT(norm(g.at("means")), 1e-6);
  EXPECT_LT(norm(g.at("quats")), 1e-6);
  EXPECT_LT(norm(g.at("scales")), 1e-6);
}

// Density control must not split a Gaussian whose only error is its motion.
TEST(Engine, TheFlowsGradientMovesAGaussianButIsNoGradientOfTheImages) {
  Queue queue = test_queue();
  PosedScene s = random_scene({0, 40, 30});
  add_gaussian(s, {.1, -.2, 4}, {.5, .3, .2}, .8, {.25, .125, 0});
  s.shot.settings.transport = Transport::translate;  // weights cancel from the flow of one Gaussian
  DeviceScene device(queue, s);
  device.forward();
  const FloatArrays g = device.backward(only(random_cotangents(s, 6), "flow"));
  EXPECT_GT(norm(g.at("means")), .1);
  for (const float v : device.gradients.v_means2d.read_range(queue, 0, 2)) EXPECT_NEAR(v, 0, 1e-5);
}

TEST(Engine, GaussiansThatAreNotSeenHaveExactlyNoGradient) {
  Queue queue = test_queue();
  PosedScene s = small_scene();
  const size_t n = s.count();
  add_gaussian(s, {0, 0, -2}, {.1, .1, .1}, .9);    // behind the camera
  add_gaussian(s, {0, 0, .001}, {.1, .1, .1}, .9);  // nearer than the near plane
  add_gaussian(s, {0, 0, 3}, {.1, .1, .1}, .003);   // too faint
  add_gaussian(s, {50, 0, 3}, {.1, .1, .1}, .9);    // beside the image
  DeviceScene device(queue, s);
  device.forward();
  for (const auto& [name, values] : device.backward(random_cotangents(s, 7))) {
    const size_t width = values.size() / s.count();
    for (size_t i = n * width; i < values.size(); ++i) EXPECT_EQ(values[i], 0.f) << name;
  }
  for (float v : device.gradients.v_means2d.read_range(queue, 2 * n, 8)) EXPECT_EQ(v, 0.f);
}

TEST(Engine, WhatPassesBehindTheSecondCameraHasNoFlow) {
  Queue queue = test_queue();
  PosedScene s = random_scene({0, 20, 20});
  add_gaussian(s, {0, 0, 2}, {.3, .3, .3}, .9, {0, 0, -4});
  DeviceScene device(queue, s);
  const FloatArrays images = device.forward();
  for (float f : images.at("flow")) EXPECT_EQ(f, 0.f);
  EXPECT_GT(images.at("alpha")[10 * 20 + 10], .5f);
  const FloatArrays g = device.backward(random_cotangents(s, 8));
  EXPECT_EQ(norm(g.at("means_t2")), 0);
  EXPECT_TRUE(all_finite(g.at("means")));
}

// T24: wide Gaussians with centres beyond the margin, where J is clamped.
TEST(Engine, GradientBesideTheImageMatchesTheReference) {
  Queue queue = test_queue();
  PosedScene s = random_scene({0, 48, 32});
  for (int i = 0; i < 8; ++i) {
    const double angle = .785 * i;
    add_gaussian(s, {3.2 * std::cos(angle), 3. * std::sin(angle), 4 + .1 * i}, {1.5, 1, .7}, .8,
                 {.1, .02 * i, .1});
  }
  const reference::Gaussians g = reference::posed(s.p);
  const reference::Rendering r = reference::render(s.shot, g);
  const reference::Planes v = random_cotangents(s, 9, r.contributors.doubtful);
  size_t held = 0;
  for (const auto& seen : r.seen) held += !seen.p.u_inside || !seen.p.v_inside;
  EXPECT_GE(held, 6u);
  DeviceScene device(queue, s);
  device.forward();
  const FloatArrays actual = device.backward(v);
  for (const auto& [name, values] :
       reference::posed_vjp(s.p, reference::render_vjp(s.shot, g, r, v)))
    EXPECT_LE(relative_l2(actual.at(name), values), 3e-5) << name;  // the requested bound is 1e-4
}

}  // namespace
}  // namespace gflow
