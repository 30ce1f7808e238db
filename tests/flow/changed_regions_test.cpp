// SPDX-License-Identifier: Apache-2.0
// Regions in which flow is computed for cameras that stand still.
#include "optim/flow/changed_regions.hpp"

#include <random>

#include "optim/flow/optical_flow.hpp"
#include "tests/support/moving_texture.hpp"

namespace gflow {
namespace {

constexpr int kWidth = 200, kHeight = 120, kMargin = 16;  // [px]

// A grey wall with noise of +-2 levels and, at (x, y), a textured square of 20 pixels.
Image wall_with_square(int x, int y, uint32_t noise) {
  Image image{kWidth, kHeight, 3, {}};
  std::mt19937 rng(noise);
  for (int v = 0; v < kHeight; ++v)
    for (int u = 0; u < kWidth; ++u) {
      const bool inside = u >= x && u < x + 20 && v >= y && v < y + 20;
      const double level =
          inside ? 80 + 50 * std::sin(0.9 * (u - x)) * std::cos(0.7 * (v - y)) : 160;
      for (int c = 0; c < 3; ++c) image.pixels.push_back(uint8_t(level + double(rng() % 5) - 2));
    }
  return image;
}

bool covers(const Rect& rect, int x, int y, int width, int height) {
  return rect.x <= x && rect.y <= y && rect.x + rect.width >= x + width &&
         rect.y + rect.height >= y + height;
}

TEST(ChangedRegions, HoldWhatMovesWithAMargin) {
  const std::vector<Rect> regions =
      changed_regions(wall_with_square(60, 40, 1), wall_with_square(65, 38, 2));
  ASSERT_EQ(regions.size(), 1u);
  EXPECT_TRUE(covers(regions[0], 60 - kMargin, 38 - kMargin, 25 + 2 * kMargin, 22 + 2 * kMargin));
  EXPECT_LT(regions[0].width * regions[0].height, kWidth * kHeight / 4);
}

TEST(ChangedRegions, AreNoneWhereOnlyNoiseChanges) {
  EXPECT_TRUE(changed_regions(wall_with_square(60, 40, 1), wall_with_square(60, 40, 2)).empty());
}

TEST(ChangedRegions, AreAllOfAnImageThatChangesEverywhere) {
  Image brighter = wall_with_square(60, 40, 1);
  for (uint8_t& level : brighter.pixels) level = uint8_t(level + 20);
  const std::vector<Rect> regions = changed_regions(wall_with_square(60, 40, 1), brighter);
  ASSERT_EQ(regions.size(), 1u);
  EXPECT_TRUE(covers(regions[0], 0, 0, kWidth, kHeight));
}

// Flow of the whole image is the reference, inside of the square and outside.
TEST(ChangedRegions, GiveTheFlowOfTheWholeImage) {
  const Image a = wall_with_square(60, 40, 1), b = wall_with_square(63, 41, 2);
  const TargetFlow flow = estimate_target_flows(a, b, CameraMotion::none).first;
  const auto at = [&](int x, int y) { return size_t(y) * kWidth + size_t(x); };
  double error = 0;
  for (int y = 44; y < 56; ++y)
    for (int x = 64; x < 76; ++x)
      error += std::hypot(flow.flow.uv[2 * at(x, y)] - 3, flow.flow.uv[2 * at(x, y) + 1] - 1);
  EXPECT_LT(error / 144, 0.15);  // whole image, finest settings: 0.1
  const size_t far = at(180, 100);
  EXPECT_EQ(flow.flow.uv[2 * far], 0);
  EXPECT_EQ(flow.flow.uv[2 * far + 1], 0);
  EXPECT_EQ(flow.confidence[far], 255);
  const TargetFlow whole = estimate_target_flows(a, b, CameraMotion::any).first;
  double sum = 0;
  for (int y = 44; y < 56; ++y)
    for (int x = 64; x < 76; ++x)
      sum += std::hypot(whole.flow.uv[2 * at(x, y)] - 3, whole.flow.uv[2 * at(x, y) + 1] - 1);
  EXPECT_LT(error, sum + 0.1 * 144);
}

}  // namespace
}  // namespace gflow
