// SPDX-License-Identifier: Apache-2.0
// Rasterisation does not read what it skips (Skips::saturated, Skips::asking). Results are bitwise
// equal with and without skips, so the skipped splats get the colour NaN, which shows whether they
// are read.
#include <gtest/gtest.h>

#include <cmath>

#include "optim/engine/posed.hpp"
#include "optim/reference/device_scene.hpp"
#include "tests/support/device.hpp"

namespace gflow {
namespace {

// A tile or two, rendered step by step, so that splats can be changed in between.
class Tile {
 public:
  Tile(Queue& queue, const PosedScene& s)
      : queue_(queue),
        project_(queue, s.shot.settings, channels),
        bin_(queue, s.shot.settings),
        splatting_(queue, s.shot.settings, channels) {
    const auto upload = [&](Buffer<float>& buffer, const char* name) {
      buffer.ensure(queue, s.p.at(name).size());
      buffer.write(queue, to_float(s.p.at(name)));
    };
    GaussiansAt at;
    Buffer<float> quats, scales, colors;
    at.ensure(queue, s.count());
    upload(at.means, "means");
    upload(at.opacities, "opacities");
    upload(quats, "quats");
    upload(scales, "scales");
    upload(colors, "colors");
    Posed(queue).forward(queue, quats, scales, at.factors);
    const PinholeCamera& camera = s.shot.camera;
    const View view{camera, camera};
    images.width = camera.width;
    images.height = camera.height;
    project_.forward(queue, view, at, splats_);
    bin_.start(queue, splats_, tiles);
    bin_.build(queue, camera.width, camera.height, splats_, tiles);
    project_.complete(queue, view, at, at, colors, splats_);
    ids = tiles.isect_ids.read(queue);
    masks = tiles.masks.read(queue);
  }

  // Whether the image or the moments of its splats contain NaN.
  bool forward_meets_nan() {
    splatting_.forward(queue_, {0, 0, 0}, splats_, tiles, images);
    return any_nan(images.rgb);
  }
  bool backward_meets_nan(const std::vector<float>& v_rgb) {
    ImageGradients v;
    v.v_rgb.ensure(queue_, v_rgb.size());
    v.v_rgb.write(queue_, v_rgb);
    v.v_alpha.ensure(queue_, v_rgb.size() / 3);
    v.v_alpha.fill(queue_, 0);
    v.v_depth.ensure(queue_, 0);
    v.v_flow.ensure(queue_, 0);
    Buffer<float> partials{"partials"};
    splatting_.backward(queue_, splats_, tiles, images, v, partials);
    return any_nan(partials);
  }

  void poison_color(cl_uint splat) {
    splats_.records.fill_range(queue_, 16 * size_t(splat) + 8, 3, NAN);
  }

  Tiles tiles;
  Images images;
  std::vector<cl_uint> ids;      // Tiles::isect_ids
  std::vector<cl_ushort> masks;  // Tiles::masks

 private:
  static constexpr Channels channels{false, false};

  bool any_nan(const Buffer<float>& buffer) {
    const std::vector<float> values = buffer.read(queue_);
    return std::any_of(values.begin(), values.end(), [](float x) { return std::isnan(x); });
  }

  Queue& queue_;
  Project project_;
  Bin bin_;
  Splatting splatting_;
  Splats splats_;
};

class LeftOut : public testing::TestWithParam<int> {
 protected:
  LeftOut() : queue(test_queue(GetParam())) {}
  Queue queue;
};
INSTANTIATE_TEST_SUITE_P(Lanes, LeftOut, testing::Values(16, 8, 4, 1),
                         testing::PrintToStringParamName());

PosedScene one_tile(size_t n, double cover, double opaque, StopRule stop) {
  SceneSpec spec;
  spec.n = n;
  spec.width = spec.height = TILE;
  spec.cover = cover;
  spec.opaque = opaque;
  PosedScene s = random_scene(spec);
  s.shot.settings.stop = stop;
  return s;
}

// Half of a tile's list is behind opaque splats.
TEST_P(LeftOut, SplatsBehindAFullTile) {
  for (const StopRule stop : {StopRule::include, StopRule::exclude})
    for (const bool saturated : {true, false}) {
      PosedScene s = one_tile(600, 300, 1, stop);
      s.shot.settings.skip.saturated = saturated;
      Tile tile(queue, s);
      ASSERT_FALSE(tile.forward_meets_nan());
      ASSERT_FALSE(tile.backward_meets_nan(std::vector<float>(3 * s.pixels(), 1.f)));
      ASSERT_GT(tile.ids.size(), 400u);
      for (size_t k = tile.ids.size() / 2; k < tile.ids.size(); ++k) tile.poison_color(tile.ids[k]);
      EXPECT_EQ(tile.backward_meets_nan(std::vector<float>(3 * s.pixels(), 1.f)), !saturated);
      EXPECT_EQ(tile.forward_meets_nan(), !saturated);
    }
}

// One cell of 4x4 pixels has gradients: the backward pass does not read splats outside of it.
TEST_P(LeftOut, CellsThatAskForNothing) {
  for (const bool asking : {true, false}) {
    PosedScene s = one_tile(200, 15, 0, StopRule::include);
    s.shot.settings.skip.zero_gradients = asking;
    Tile tile(queue, s);
    ASSERT_FALSE(tile.forward_meets_nan());
    std::vector<float> v_rgb(3 * s.pixels(), 0.f);
    const size_t x = 4 * 2 + 1, y = 4 * 1 + 3, cell = 1 * 4 + 2;
    v_rgb[y * TILE + x] = 1;
    ASSERT_FALSE(tile.backward_meets_nan(v_rgb));
    size_t elsewhere = 0;
    for (size_t k = 0; k < tile.ids.size(); ++k)
      if (tile.masks[k] && !(tile.masks[k] >> cell & 1)) {
        tile.poison_color(tile.ids[k]);
        ++elsewhere;
      }
    ASSERT_GT(elsewhere, 20u);
    ASSERT_LT(elsewhere, tile.ids.size());
    EXPECT_EQ(tile.backward_meets_nan(v_rgb), !asking);
  }
}

}  // namespace
}  // namespace gflow
