// SPDX-License-Identifier: Apache-2.0
// The kernels against the double reference, images and gradients, for every lane width: scenes of
// odd sizes, with no splat, one, no visible one, ties in depth, one splat over all tiles, hundreds
// of layers.
#include <gtest/gtest.h>

#include "optim/reference/device_scene.hpp"
#include "tests/support/compare.hpp"
#include "tests/support/device.hpp"

namespace gflow {
namespace {

using reference::Rendering;

// Error bounds of float32. Images: alpha is accurate to 1e-6 (exponent up to 8, polynomial 2e-7),
// and a pixel sums weights that add up to 1. Flow is in px; its error grows with the size of the
// splats. Gradients: relative L2 of the worst-conditioned class.
struct Bounds {
  double image = 5e-6, flow = 1e-4, gradient = 1e-5;
};

void expect_images(const PosedScene& s, const FloatArrays& actual, const Rendering& expected,
                   Bounds bounds = {}) {
  const auto& doubtful = expected.contributors.doubtful;
  size_t left_out = 0;
  for (uint8_t d : doubtful) left_out += d;
  EXPECT_LE(left_out, s.pixels() / 20 + 1);
  const reference::Planes& e = expected.images;
  EXPECT_LT(largest_error(actual.at("rgb"), e.rgb, doubtful), bounds.image);
  EXPECT_LT(largest_error(actual.at("alpha"), e.alpha, doubtful), bounds.image);
  EXPECT_LT(largest_error(actual.at("depth"), e.depth, doubtful),
            bounds.image * std::max(1., largest(e.depth)));
  EXPECT_LT(largest_error(actual.at("flow"), e.flow, doubtful), bounds.flow);
}

// Renders and differentiates s on the device and in double.
void expect_reference(Queue& queue, const PosedScene& s, Bounds bounds = {}) {
  const reference::Gaussians g = reference::posed(s.p);
  const Rendering expected = reference::render(s.shot, g);
  DeviceScene device(queue, s);
  expect_images(s, device.forward(), expected, bounds);

  const reference::Planes all = random_cotangents(s, 11, expected.contributors.doubtful);
  for (const std::string image : {"rgb", "depth", "flow"}) {
    reference::Planes v = only(all, image);
    if (image == "rgb") v.alpha = all.alpha;
    const reference::Named v_expected =
        reference::posed_vjp(s.p, reference::render_vjp(s.shot, g, expected, v));
    const FloatArrays v_actual = device.backward(v);
    // 3e-8: for gradients that are exactly 0 (the flow of one splat does not depend on its
    // opacity).
    for (const auto& [name, values] : v_expected)
      EXPECT_LE(distance(v_actual.at(name), values), bounds.gradient * norm(values) + 3e-8)
          << image << " by " << name << ", " << norm(values);
  }
}

PosedScene scene_of(size_t n, int width, int height, unsigned seed = 1) {
  SceneSpec spec;
  spec.n = n;
  spec.width = width;
  spec.height = height;
  spec.seed = seed;
  PosedScene s = random_scene(spec);
  s.shot.settings.transport = Transport::material;
  return s;
}

class Splat : public testing::TestWithParam<int> {
 protected:
  Splat() : queue(test_queue(GetParam())) {}
  bool narrow() const { return GetParam() == 1; }  // slow on a CPU: smaller scenes
  Queue queue;
};
INSTANTIATE_TEST_SUITE_P(Lanes, Splat, testing::Values(16, 8, 4, 1),
                         testing::PrintToStringParamName());

TEST_P(Splat, MatchesTheReferenceOnImagesOfOddSizes) {
  const int sizes[][2] = {{1, 1}, {17, 15}, {33, 1}, {2, 37}};
  for (const auto [width, height] : sizes) {
    SCOPED_TRACE(std::to_string(width) + " x " + std::to_string(height));
    // So few pixels do not average out rounding.
    expect_reference(queue, scene_of(60, width, height), {5e-6, 1e-4, 1e-4});
  }
}

TEST_P(Splat, MatchesTheReferenceOnAWideImage) {  // T38: width and height must not be confused
  expect_reference(queue, narrow() ? scene_of(150, 96, 29) : scene_of(400, 320, 96));
}

// The other stop rule and the K of the paper. Programs compile slowly: only the widest and the
// narrowest.
class SplatModes : public Splat {};
INSTANTIATE_TEST_SUITE_P(Lanes, SplatModes, testing::Values(16, 1),
                         testing::PrintToStringParamName());

TEST_P(SplatModes, StopBeforeTheSaturatingSplatAndMakeFlowOfTheFirstContributors) {
  SceneSpec spec;
  spec.cover = 60;
  spec.opaque = .3;
  PosedScene s = random_scene(spec);
  s.shot.settings.stop = StopRule::exclude;
  s.shot.settings.top_k = 3;
  s.shot.settings.transport = Transport::paper;
  // Opaque layers: alpha/(1 - alpha), up to 99, multiplies the rounding of splats behind.
  expect_reference(queue, s, {5e-6, 1e-4, 1e-4});
}

// The backward pass skips cells without gradients, whole tiles among them, and flow where nothing
// moves or has a gradient, with the same result except for the sign of zeros.
TEST_P(SplatModes, LeavesOutWhatAsksForNothing) {
  PosedScene s = scene_of(narrow() ? 100 : 300, 75, 52);
  reference::Planes v = random_cotangents(s, 5);
  for (int y = 0; y < 52; ++y)
    for (int x = 0; x < 75; ++x) {
      const size_t at = size_t(y) * 75 + x;
      if (x >= 32 || (y >= 20 && y < 40)) v.flow[at] = v.flow[at + s.pixels()] = 0;
      if (x < 48 && (x < 9 || y < 17 || x > y + 5)) continue;
      v.flow[at] = v.flow[at + s.pixels()] = v.alpha[at] = v.depth[at] = 0;
      for (size_t c = 0; c < 3; ++c) v.rgb[at + c * s.pixels()] = 0;
    }
  for (const size_t moving : {s.count(), s.count() / 20}) {
    std::vector<FloatArrays> images, gradients;
    for (const bool skip : {false, true}) {
      s.shot.settings.skip.zero_gradients = s.shot.settings.skip.flow = skip;
      DeviceScene device(queue, s);
      device.flow_in_parts = skip;
      if (moving < s.count()) device.stand_still_from(moving);
      images.push_back(device.forward());
      EXPECT_EQ(device.engine.tiles_with_flow() != nullptr, skip && moving < s.count());
      ImageGradients in_parts;
      in_parts.flow_in_parts = true;
      EXPECT_EQ(device.engine.flow_in_parts(in_parts), skip);
      gradients.push_back(device.backward(v));
    }
    EXPECT_EQ(images[0], images[1]) << moving;
    EXPECT_EQ(gradients[0], gradients[1]) << moving;  // 0 == -0
    EXPECT_GT(norm(gradients[0].at("means_t2")), 0);
  }
}

// Flow of some tiles only (View::flow_tiles): the same bits there and in everything else, no flow
// elsewhere. A Gaussian that touches no such tile needs no pose at t2.
TEST_P(SplatModes, HasTheFlowOfTheTilesThatAreAskedOf) {
  const int tiles_x = 5, tiles_y = 4;
  std::vector<float> tiles(size_t(tiles_x * tiles_y), 0.f);
  for (const size_t tile : {0, 1, 7, 14, 19}) tiles[tile] = 4;
  const auto asked = [&](size_t pixel) {
    return tiles[pixel / 75 / 16 * size_t(tiles_x) + pixel % 75 / 16] != 0;
  };
  struct Way {
    size_t moving;  // of ten
    bool skip_flow;
    int top_k;
  };
  for (const Way way :
       {Way{10, true, 0}, {3, true, 0}, {3, false, 0}, {0, true, 0}, {3, true, 3}, {0, true, 3}}) {
    SCOPED_TRACE(
        fmt::format("{} of 10 move, skip {}, top {}", way.moving, way.skip_flow, way.top_k));
    PosedScene s = scene_of(narrow() ? 100 : 300, 75, 52);
    s.shot.settings.skip.flow = way.skip_flow;
    s.shot.settings.top_k = way.top_k;
    const size_t moving = s.count() * way.moving / 10;
    reference::Planes v = random_cotangents(s, 5);
    for (size_t i = 0; i < s.pixels(); ++i)
      if (!asked(i)) v.flow[i] = v.flow[i + s.pixels()] = 0;
    PosedScene whole = s;  // rendered by the kernel for flow alone
    whole.shot.settings.skip.flow = false;
    DeviceScene all(queue, whole), some(queue, s);
    some.ask_flow_of(tiles);
    if (moving < s.count()) all.stand_still_from(moving), some.stand_still_from(moving);
    FloatArrays expected = all.forward(), images = some.forward();
    for (size_t i = 0; i < s.pixels(); ++i)
      if (!asked(i)) expected["flow"][i] = expected["flow"][i + s.pixels()] = 0;
    EXPECT_EQ(images, expected);
    EXPECT_EQ(norm(images.at("flow")) > 1, moving > 0);

    const Splats& splats = some.engine.splats();
    const std::vector<cl_uint> with_flow = splats.rows_with_flow().read(queue);
    const std::vector<cl_uint> seen = splats.tiles_touched.read(queue);
    size_t spared = 0;
    for (size_t i = 0; i < s.count(); ++i) {
      if (with_flow[i]) {
        EXPECT_GT(seen[i], 0u);
        continue;
      }
      some.break_second_pose_of(i);
      spared += seen[i] > 0;
    }
    EXPECT_GT(spared, s.count() / 20);
    EXPECT_LT(spared, s.count() / 2);
    EXPECT_EQ(some.forward(), images);
    const FloatArrays gradients = some.backward(v), expected_gradients = all.backward(v);
    for (const auto& [name, values] : expected_gradients) {     // 0 == -0
      if (name == "quats_t2" || name == "scales_t2") continue;  // through the broken poses
      EXPECT_EQ(gradients.at(name), values) << name;
    }
    EXPECT_EQ(some.gradients.v_factors_t2.read(queue), all.gradients.v_factors_t2.read(queue));
    EXPECT_GT(norm(gradients.at("means_t2")), 0);
  }
}

TEST_P(Splat, DrawsTheBackgroundWhereNothingIs) {
  for (PosedScene s : {scene_of(0, 19, 5), [] {
                         PosedScene behind = scene_of(0, 19, 5);
                         for (int i = 0; i < 9; ++i)
                           add_gaussian(behind, {0, 0, -3}, {.5, .5, .5}, .9);
                         return behind;
                       }()}) {
    DeviceScene device(queue, s);
    const FloatArrays images = device.forward();
    for (size_t i = 0; i < s.pixels(); ++i) {
      for (int c = 0; c < 3; ++c)
        EXPECT_EQ(images.at("rgb")[c * s.pixels() + i], float(s.shot.background[c]));
      EXPECT_EQ(images.at("alpha")[i], 0);
      EXPECT_EQ(images.at("depth")[i], 0);
      EXPECT_EQ(images.at("flow")[i], 0);
    }
    for (const auto& [name, values] : device.backward(random_cotangents(s, 3)))
      for (float v : values) EXPECT_EQ(v, 0) << name;
  }
}

TEST_P(Splat, DrawsOneGaussian) {
  PosedScene s = scene_of(0, 21, 13);
  add_gaussian(s, {.05, -.02, 4}, {.4, .2, .3}, .8, {.05, .02, -.1});
  expect_reference(queue, s);
}

// At equal depth the index decides. The colours differ, so a wrong order is visible.
TEST_P(Splat, BreaksTiesInDepthByIndex) {
  PosedScene s = scene_of(0, 24, 18);
  s.shot.camera = s.shot.camera_t2 = test_camera(24, 18);  // unrotated: z is exact
  std::mt19937 rng(2);
  for (int i = 0; i < 40; ++i) {
    const double x = double(rng() % 100) / 100 - .5, y = double(rng() % 100) / 150 - .33;
    add_gaussian(s, {2 * x, 2 * y, 2}, {.2, .1, .1}, .6, {x, y * x, .1 * y});
    for (int c = 0; c < 3; ++c) s.p["colors"][3 * i + c] = double(float(rng() % 100) / 100);
  }
  expect_reference(queue, s);
}

TEST_P(Splat, DrawsOneSplatOverAllTiles) {  // T22
  PosedScene s = scene_of(60, 70, 50);
  add_gaussian(s, {0, 0, 6}, {6, 5, 1}, .9, {.1, 0, 0});
  // The moments of the large splat sum 3500 pixels of random sign, which cancel more.
  expect_reference(queue, s, {5e-6, 1e-4, 3e-5});
}

TEST_P(Splat, BlendsHundredsOfLayers) {  // T16: faint ones over an opaque one
  PosedScene s = scene_of(0, 9, 9);
  std::mt19937 rng(4);
  for (int i = 0; i < 300; ++i) {
    const double x = double(rng() % 1000) / 1000 - .5, y = double(rng() % 1000) / 1000 - .5;
    add_gaussian(s, {x, y, 2 + .01 * i}, {1.5, 1.2, 1}, .02 + .04 * double(rng() % 100) / 100,
                 {.02 * x, .01, 0});
    for (int c = 0; c < 3; ++c) s.p["colors"][3 * i + c] = double(float(rng() % 100) / 100);
  }
  add_gaussian(s, {0, 0, 6}, {4, 4, 1}, 1);
  // 300 multiplications of T: 300 x 6e-8; for splats of 5 px with small slopes differences cancel.
  expect_reference(queue, s, {2e-5, 1e-4, 5e-5});
}

// If one part of a tile is opaque, the others continue: splats behind are visible there.
TEST_P(Splat, AnOpaquePartDoesNotCloseItsTile) {
  PosedScene s = scene_of(0, 16, 16);
  s.shot.camera = s.shot.camera_t2 = test_camera(16, 16);
  std::mt19937 rng(5);
  for (int i = 0; i < 80; ++i) {  // the first 40 in the upper left corner
    const double x = i < 40 ? -.8 : .3, jitter = .05 * (double(rng() % 100) / 100 - .5);
    const double size = i < 40 ? .3 : .1;  // the first ones cover some pixels completely
    add_gaussian(s, {x + jitter, x - jitter, 2 + .02 * i}, {size, size, size}, i < 40 ? .9 : .1,
                 {jitter, .02, 0});
    for (int c = 0; c < 3; ++c) s.p["colors"][3 * i + c] = double(float(rng() % 100) / 100);
  }
  // Opaque layers: alpha/(1 - alpha) multiplies the rounding of splats behind.
  expect_reference(queue, s, {5e-6, 1e-4, 1e-4});
}

TEST_P(Splat, DrawsAFewSplatsInAFullHdImage) {
  PosedScene s = scene_of(0, narrow() ? 640 : 1920, narrow() ? 360 : 1080);
  std::mt19937 rng(7);
  for (int i = 0; i < 12; ++i) {
    const double x = double(rng() % 1000) / 1000 - .5, y = .5 * (double(rng() % 1000) / 1000 - .5);
    add_gaussian(s, {3 * x, 3 * y, 3. + .125 * i}, {.02, .004, .01}, .9, {.01, .005, .02});
  }
  // Pixel coordinates of 1e3 are rounded by 6e-5 px; for a splat 2 px wide that is 3e-5 of z, and
  // 1e-4 of the slope of the exponent there.
  const Bounds bounds{2e-4, 1e-3, 2e-3};
  const Rendering expected = reference::render(s.shot, reference::posed(s.p));
  DeviceScene device(queue, s);
  expect_images(s, device.forward(), expected, bounds);
}

}  // namespace
}  // namespace gflow
