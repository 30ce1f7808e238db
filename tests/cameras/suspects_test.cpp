// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/suspects.hpp"

#include <gtest/gtest.h>

#include "tests/support/room_video.hpp"

namespace gflow {
namespace {

const RoomVideo& lively_room() {
  static const RoomVideo room({0.06, 0.02, 0.03});
  return room;
}

size_t count(const Mask& mask) {
  return size_t(std::count(mask.pixels.begin(), mask.pixels.end(), 1));
}

TEST(Suspects, ContainWhatMovesAndLittleElse) {
  const RoomVideo& room = lively_room();
  std::vector<size_t> done;
  const Suspects found = suspects_of(room.video, {2000}, [&](size_t k, size_t n) {
    EXPECT_EQ(n, size_t(RoomVideo::frames));
    done.push_back(k);
  });
  EXPECT_EQ(done.size(), size_t(RoomVideo::frames));
  ASSERT_EQ(found.masks.size(), size_t(RoomVideo::frames));
  size_t caught = 0, moving = 0, suspected = 0;
  for (size_t k = 0; k < found.masks.size(); ++k) {
    const Mask& truth = room.moving[k];
    moving += count(truth), suspected += count(found.masks[k]);
    for (size_t i = 0; i < truth.pixels.size(); ++i)
      caught += truth.pixels[i] && found.masks[k].pixels[i];
  }
  EXPECT_GT(double(caught), 0.8 * double(moving));  // flow may be unknown at occluded edges
  // Edges of the boards are suspects as well.
  const double pixels = RoomVideo::frames * RoomVideo::width * RoomVideo::height;
  EXPECT_LT(double(suspected), double(moving) + 0.25 * pixels);
}

TEST(Suspects, PointsLieOnSurfacesAtRest) {
  const RoomVideo& room = lively_room();
  const Suspects found = suspects_of(room.video, {2000}, {});
  const size_t n = found.points.size();
  ASSERT_GT(n, 1000u);
  EXPECT_LE(n, 2200u);
  ASSERT_EQ(found.points.rgb.size(), 3 * n);
  size_t near = 0;
  for (size_t i = 0; i < n; ++i) {
    const Eigen::Map<const Eigen::Vector3d> point(&found.points.xyz[3 * i]);
    // Floor, wall, and the first board: x = -1.6 + 0.8 u, y = 0.6 + 0.6 u.
    const double board = std::fabs(0.6 * (point.x() + 1.6) - 0.8 * (point.y() - 0.6));
    near += std::min({std::fabs(point.z()), std::fabs(point.y() - 3), board}) < 0.1;
  }
  EXPECT_GT(double(near), 0.9 * double(n));
}

TEST(Suspects, AreFewWhereNothingMoves) {
  const RoomVideo room(Eigen::Vector3d::Zero());
  const Suspects found = suspects_of(room.video, {10}, {});
  size_t on_board = 0, board = 0;
  for (size_t k = 0; k < found.masks.size(); ++k)
    for (size_t i = 0; i < found.masks[k].pixels.size(); ++i) {
      board += room.moving[k].pixels[i];
      on_board += room.moving[k].pixels[i] && found.masks[k].pixels[i];
    }
  EXPECT_LT(double(on_board), 0.4 * double(board));  // its edges
}

}  // namespace
}  // namespace gflow
