// SPDX-License-Identifier: Apache-2.0
// Tile lists against a plain sort on the host, slots against counts, boxes and cell masks against
// the pixels that a splat touches.
#include <gtest/gtest.h>

#include "optim/reference/device_scene.hpp"
#include "tests/support/device.hpp"

namespace gflow {
namespace {

// The results of binning a scene, read back.
struct Binned {
  PosedScene scene;
  cl_uint tiles_x, tiles_y;
  std::vector<float> records;
  std::vector<cl_ushort> boxes, masks;
  std::vector<cl_uint> touched, slot_offsets, tile_offsets, ids, slots;
  size_t tiles() const { return size_t(tiles_x) * tiles_y; }
};
Binned binned(Queue& queue, const PosedScene& s) {
  DeviceScene device(queue, s);
  device.forward();
  const Splats& splats = device.engine.splats();
  const Tiles& tiles = device.engine.tiles();
  return {s,
          tiles.x,
          tiles.y,
          splats.records.read(queue),
          splats.tile_boxes.read(queue),
          tiles.masks.read(queue),
          splats.tiles_touched.read(queue),
          tiles.slot_offsets.read(queue),
          tiles.tile_offsets.read(queue),
          tiles.isect_ids.read(queue),
          tiles.isect_slots.read(queue)};
}

// Half of the Gaussians share a depth with another one; 2000 Gaussians make several chunks.
PosedScene scene_with_ties() {
  SceneSpec spec;
  spec.n = 1000;
  spec.width = 150;
  spec.height = 70;
  PosedScene s = random_scene(spec);
  for (auto& [name, values] : s.p) {
    const std::vector<double> once = values;
    values.insert(values.end(), once.begin(), once.end());
  }
  return s;
}

// Lanes 0: the device's own; 1: as on a GPU, where the lists are sorted.
class BinLists : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Lanes, BinLists, testing::Values(0, 1));

TEST_P(BinLists, ListsEachTilesSplatsByDepthAndThenByIndex) {
  Queue queue = test_queue(GetParam());
  const Binned b = binned(queue, scene_with_ties());
  std::vector<std::vector<cl_uint>> expected(b.tiles());
  for (cl_uint i = 0; i < b.scene.count(); ++i) {
    if (!b.touched[i]) continue;
    for (cl_uint y = b.boxes[4 * i + 1]; y <= b.boxes[4 * i + 3]; ++y)
      for (cl_uint x = b.boxes[4 * i]; x <= b.boxes[4 * i + 2]; ++x)
        expected[y * b.tiles_x + x].push_back(i);
  }
  ASSERT_EQ(b.tile_offsets.size(), b.tiles() + 1);
  ASSERT_EQ(b.tile_offsets[0], 0u);
  for (size_t t = 0; t < b.tiles(); ++t) {
    const auto depth = [&](cl_uint i) { return b.records[16 * i + 6]; };
    std::sort(expected[t].begin(), expected[t].end(), [&](cl_uint i, cl_uint j) {
      return std::make_pair(depth(i), i) < std::make_pair(depth(j), j);
    });
    const std::vector<cl_uint> actual(b.ids.begin() + b.tile_offsets[t],
                                      b.ids.begin() + b.tile_offsets[t + 1]);
    EXPECT_EQ(actual, expected[t]) << t;
  }
  EXPECT_EQ(b.tile_offsets.back(), b.ids.size());
}

// Other kinds of scenes: both methods give the same lists, also if some splats cover every tile, if
// there is one tile, and if nothing is visible.
TEST(Bin, CountsAndSortsTheSameLists) {
  for (const auto& [width, height, cover] :
       {std::tuple{700, 300, 150.}, {16, 16, 5.}, {333, 1, 3.}, {40, 30, 0.}}) {
    SceneSpec spec;
    spec.n = 3000;
    spec.width = width;
    spec.height = height;
    spec.cover = std::max(cover, 1.);
    PosedScene s = random_scene(spec);
    if (cover == 0) s.p["opacities"].assign(spec.n, 0.);
    Queue counting = test_queue(), sorting = test_queue(1);
    const Binned a = binned(counting, s), b = binned(sorting, s);
    EXPECT_EQ(a.ids.empty(), cover == 0);
    EXPECT_EQ(a.tile_offsets, b.tile_offsets) << width;
    EXPECT_EQ(a.ids, b.ids) << width;
    EXPECT_EQ(a.slots, b.slots) << width;
  }
}

TEST_P(BinLists, GivesEveryIntersectionASlotOfItsGaussian) {
  Queue queue = test_queue(GetParam());
  const Binned b = binned(queue, scene_with_ties());
  std::vector<int> used(b.ids.size());
  for (size_t k = 0; k < b.ids.size(); ++k) {
    EXPECT_GE(b.slots[k], b.slot_offsets[b.ids[k]]);
    EXPECT_LT(b.slots[k], b.slot_offsets[b.ids[k] + 1]);
    ++used[b.slots[k]];
  }
  EXPECT_EQ(used, std::vector<int>(used.size(), 1));
}

// Thousands of full-screen splats: counted in 64 bits, and rejected before anything is allocated.
// The second total is 5 in 32 bits.
TEST_P(BinLists, RefusesIntersectionsPastTwoToThe31BeforeItAllocates) {
  Queue queue = test_queue(GetParam());
  for (const auto& [each, splats] :
       {std::pair<cl_uint, size_t>{1u << 20, 2048}, std::pair<cl_uint, size_t>{0x33333334u, 5}}) {
    const uint64_t total = uint64_t(each) * splats;
    Bin bin(queue, {});
    Splats many;
    many.count = splats;
    many.tiles_touched = Buffer<cl_uint>(queue, std::vector<cl_uint>(splats, each), "touched");
    Tiles tiles;
    bin.start(queue, many, tiles);
    try {
      bin.build(queue, 1600, 1200, many, tiles);
      ADD_FAILURE() << total << " were accepted";
    } catch (const Error& problem) {
      EXPECT_NE(std::string(problem.what()).find(std::to_string(total) + " intersections"),
                std::string::npos)
          << problem.what();
    }
    for (const Buffer<cl_uint>* made : {&tiles.isect_ids, &tiles.isect_slots})
      EXPECT_EQ(made->capacity(), 0u) << total;
    EXPECT_EQ(tiles.masks.capacity(), 0u) << total;
  }
}

class BinLanes : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Lanes, BinLanes, testing::Values(16, 8, 4, 1),
                         testing::PrintToStringParamName());

// Needles of every direction among round splats.
TEST_P(BinLanes, BoxesAndCellMasksMissNoPixelAndSkipMost) {
  Queue queue = test_queue(GetParam());
  SceneSpec spec;
  spec.n = 250;
  spec.width = 90;
  spec.height = 50;
  spec.cover = 6;
  spec.aspect = 1.5;
  const Binned b = binned(queue, random_scene(spec));
  // (Gaussian, tile) -> mask
  std::map<std::pair<cl_uint, size_t>, cl_ushort> masks;
  for (size_t t = 0; t < b.tiles(); ++t)
    for (cl_uint k = b.tile_offsets[t]; k < b.tile_offsets[t + 1]; ++k)
      masks[{b.ids[k], t}] = b.masks[k];
  const auto seen = reference::see(b.scene.shot, reference::posed(b.scene.p));
  size_t touched_pixels = 0, missed = 0;
  for (cl_uint i = 0; i < seen.size(); ++i)
    for (size_t pixel = 0; pixel < b.scene.pixels(); ++pixel) {
      const double q = distance2(seen[i], reference::pixel_centre(b.scene.shot, pixel));
      if (!seen[i].drawn || seen[i].opacity * std::exp(-.5 * q) < 1 / 255.) continue;
      const size_t x = pixel % spec.width, y = pixel / spec.width;
      const auto found = masks.find({i, y / 16 * b.tiles_x + x / 16});
      const size_t cell = y % 16 / 4 * 4 + x % 16 / 4;
      ++touched_pixels;
      missed += found == masks.end() || !(found->second >> cell & 1);
    }
  EXPECT_GT(touched_pixels, 10000u);
  EXPECT_EQ(missed, 0u);
  // An ideal mask contains exactly the cells of the touched pixels: the reference for these bounds.
  size_t cells = 0;
  for (const auto& [key, mask] : masks) cells += size_t(__builtin_popcount(mask));
  EXPECT_LT(cells, 16 * masks.size() / 2);
  EXPECT_LT(cells, touched_pixels);  // a touched cell has several touched pixels on average
}

}  // namespace
}  // namespace gflow
