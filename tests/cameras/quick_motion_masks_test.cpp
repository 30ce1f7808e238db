// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/quick_motion_masks.hpp"

#include <gtest/gtest.h>

#include "tests/support/room_video.hpp"

namespace gflow {
namespace {

TEST(QuickMotionMasks, CoverWhatMoves) {
  const RoomVideo room({0.06, 0.02, 0.03});
  std::vector<size_t> done;
  const std::vector<Mask> masks = quick_motion_masks(room.video, [&](size_t k, size_t n) {
    EXPECT_EQ(n, size_t(RoomVideo::frames));
    done.push_back(k);
  });
  EXPECT_EQ(done.size(), size_t(RoomVideo::frames));
  ASSERT_EQ(masks.size(), size_t(RoomVideo::frames));
  EXPECT_GT(overlap(masks, room.moving), 0.6);
  size_t marked = 0, wrongly = 0;
  for (size_t k = 0; k < masks.size(); ++k)
    for (size_t i = 0; i < masks[k].pixels.size(); ++i) {
      marked += masks[k].pixels[i];
      wrongly += masks[k].pixels[i] && !room.moving[k].pixels[i];
    }
  EXPECT_LT(double(wrongly), 0.05 * double(marked));
}

TEST(QuickMotionMasks, AreNearlyEmptyWhereNothingMoves) {
  const RoomVideo room(Eigen::Vector3d::Zero());
  size_t moving = 0;
  for (const Mask& mask : quick_motion_masks(room.video, {}))
    moving += size_t(std::count(mask.pixels.begin(), mask.pixels.end(), 1));
  EXPECT_LT(double(moving), 0.003 * RoomVideo::frames * RoomVideo::width * RoomVideo::height);
}

}  // namespace
}  // namespace gflow
