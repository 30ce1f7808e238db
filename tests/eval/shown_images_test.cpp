// SPDX-License-Identifier: Apache-2.0
#include "optim/eval/shown_images.hpp"

#include <gtest/gtest.h>

#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

TEST(ShownImages, ColourIsInterleavedCutAndRounded) {
  const Image image = image_of_rgb(2, 1, {0, 1, 0.5f, -1, 2, 0.25f});  // planes r, g, b
  EXPECT_EQ(image.channels, 3);
  EXPECT_EQ(image.pixels, (std::vector<uint8_t>{0, 128, 255, 255, 0, 64}));
}

TEST(ShownImages, ExpectedDepthIsTheMeanOverTheWeightsAndZeroWhereNothingIs) {
  EXPECT_EQ(expected_depth({3, 0, 1}, {0.75f, 0, 0.25f}), (std::vector<float>{4, 0, 4}));
}

TEST(ShownImages, DepthCountsHoldTheDepthToHalfAUnit) {
  for (const float most : {0.001f, 1.f, 6.5f, 6.6f, 1234.f}) {
    const std::vector<float> depth{0, most, most / 3, most / 1e7f};
    const DepthCounts counted = count_depth(depth);
    EXPECT_EQ(counted.counts[0], 0);
    EXPECT_EQ(counted.counts[3], 1);          // present, though too near to count
    EXPECT_GT(counted.counts[1], 65535 / 3);  // units of 1, 2, 5 use at least a third of the range
    for (size_t i = 0; i < 3; ++i)
      EXPECT_NEAR(counted.counts[i] * counted.unit, depth[i], 0.501 * counted.unit);
  }
  EXPECT_EQ(count_depth({0, 0}).counts, (std::vector<uint16_t>{0, 0}));
}

TEST(ShownImages, FlowIsKnownWhereSomethingIsSeen) {
  const FlowField flow = flow_of_planes(2, 1, {1, 2, 3, 4}, {0.5f, 0.001f});
  EXPECT_EQ(flow.uv, (std::vector<float>{1, 3, 0, 0}));
  EXPECT_EQ(flow.valid, (std::vector<uint8_t>{1, 0}));
}

TEST(ShownImages, FlowLengthLeavesOutTheLongest) {
  FlowField flow = zero_flow(10, 10);
  for (size_t i = 0; i < 100; ++i) flow.uv[2 * i] = float(i);
  EXPECT_EQ(flow_length_above(flow, 0.05), 95);
  flow.valid.assign(100, 0);
  EXPECT_EQ(flow_length_above(flow, 0.05), 0);
}

TEST(ShownImages, ErrorIsEnlargedAndCut) {
  const Image a{2, 1, 1, {10, 200}}, b{2, 1, 1, {13, 100}};
  EXPECT_EQ(error_image(a, b, 4).pixels, (std::vector<uint8_t>{12, 255}));
  expect_error([&] { error_image(a, Image{1, 1, 1, {0}}, 4); }, {"2x1", "1x1"});
}

TEST(ShownImages, StandSideBySideRowByRow) {
  const Image a{1, 2, 3, {1, 2, 3, 4, 5, 6}}, b{1, 2, 3, {7, 8, 9, 10, 11, 12}};
  const Image row = side_by_side({a, b});
  EXPECT_EQ(row.width, 2);
  EXPECT_EQ(row.height, 2);
  EXPECT_EQ(row.pixels, (std::vector<uint8_t>{1, 2, 3, 7, 8, 9, 4, 5, 6, 10, 11, 12}));
}

}  // namespace
}  // namespace gflow
