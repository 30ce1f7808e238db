// SPDX-License-Identifier: Apache-2.0
// The engine writes all its promised outputs and nothing else: poisoned memory (Queue::poisons)
// reveals both. Uses images of several sizes, so that memory is reused.
#include <gtest/gtest.h>

#include "optim/reference/device_scene.hpp"
#include "tests/support/device.hpp"
#include "tests/support/environment.hpp"

namespace gflow {
namespace {

// Number of elements that were never written or, for floats, are computed from such elements.
size_t unwritten(const std::vector<float>& values) {
  return size_t(std::count_if(values.begin(), values.end(), [](float x) { return x != x; }));
}
size_t unwritten(const std::vector<cl_uint>& values) {
  return size_t(std::count(values.begin(), values.end(), poison));
}
size_t unwritten(const std::vector<cl_ushort>& values) {
  return size_t(std::count(values.begin(), values.end(), cl_ushort(poison)));
}

class Poison : public testing::TestWithParam<int> {
 protected:
  const Environment wanted_{"GFLOW_POISON_BUFFERS", "1"};
};
INSTANTIATE_TEST_SUITE_P(Lanes, Poison, testing::Values(16, 8, 4, 1),
                         testing::PrintToStringParamName());

// Some Gaussians are not seen. Behind an opaque front every tile saturates long before the end of
// its list.
PosedScene scene_of(size_t n, int width, int height, bool opaque_front) {
  SceneSpec spec;
  spec.n = n;
  spec.width = width;
  spec.height = height;
  spec.seed = 4;
  PosedScene s = random_scene(spec);
  for (size_t i = 0; i < n; i += 2) s.p["opacities"][i] = 0.98;
  for (size_t i = 0; i < n; i += 7) s.p["opacities"][i] = 0;
  if (opaque_front)
    for (int i = 0; i < 5; ++i) add_gaussian(s, {0, 0, 1 + .01 * i}, {4, 4, .1}, .98);
  return s;
}

// Rows of seen Gaussians have all values; other rows have none.
void expect_rows(const Buffer<float>& buffer, Queue& queue, size_t width,
                 const std::vector<cl_uint>& tiles_touched) {
  const std::vector<float> values = buffer.read(queue);
  ASSERT_EQ(values.size(), width * tiles_touched.size()) << buffer.name();
  size_t missing = 0, left_alone = 0, unseen = 0;
  for (size_t i = 0; i < tiles_touched.size(); ++i) {
    const auto row = values.begin() + long(width * i);
    const size_t count = unwritten(std::vector<float>(row, row + long(width)));
    (tiles_touched[i] ? missing : left_alone) += count;
    unseen += tiles_touched[i] == 0;
  }
  EXPECT_EQ(missing, 0u) << buffer.name();
  EXPECT_EQ(left_alone, unseen * width) << buffer.name();
}

TEST_P(Poison, EveryOutputOfTheEngineIsWrittenAndWhatIsNotSeenIsLeftAlone) {
  Queue queue = test_queue(GetParam());
  for (const auto& [n, width, height, opaque_front] : {std::tuple{size_t(300), 45, 30, false},
                                                       {size_t(100), 17, 33, false},
                                                       {size_t(300), 21, 18, true}}) {
    SCOPED_TRACE(fmt::format("{} Gaussians, {} x {} pixels", n, width, height));
    const PosedScene s = scene_of(n, width, height, opaque_front);
    DeviceScene device(queue, s);
    device.keep_gradients = true;
    for (const auto& [name, plane] : device.forward()) EXPECT_EQ(unwritten(plane), 0u) << name;

    const Tiles& tiles = device.engine.tiles();
    for (const Buffer<cl_uint>* buffer :
         {&tiles.slot_offsets, &tiles.tile_offsets, &tiles.isect_ids, &tiles.isect_slots})
      EXPECT_EQ(unwritten(buffer->read(queue)), 0u) << buffer->name();
    EXPECT_EQ(unwritten(tiles.masks.read(queue)), 0u);

    const Splats& splats = device.engine.splats();
    const std::vector<cl_uint> touched = splats.tiles_touched.read(queue);
    ASSERT_EQ(unwritten(touched), 0u);
    ASSERT_GT(std::count(touched.begin(), touched.end(), 0u), 0);
    expect_rows(splats.records, queue, 16, touched);

    device.backward(random_cotangents(s, 1));
    const GaussianGradients& v = device.gradients;
    expect_rows(v.v_means, queue, 3, touched);
    expect_rows(v.v_factors, queue, 9, touched);
    expect_rows(v.v_opacities, queue, 1, touched);
    expect_rows(v.v_colors, queue, 3, touched);
    expect_rows(v.v_means2d, queue, 2, touched);
    expect_rows(v.v_means_t2, queue, 3, touched);
    expect_rows(v.v_factors_t2, queue, 9, touched);
  }
}

}  // namespace
}  // namespace gflow
