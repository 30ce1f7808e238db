// SPDX-License-Identifier: Apache-2.0
#include "optim/movers/movers.hpp"

#include <gtest/gtest.h>

#include "optim/movers/paths.hpp"
#include "tests/support/room_video.hpp"

namespace gflow {
namespace {

const Eigen::Vector3d kCalmStep(0.004, 0, 0.004);

const RoomVideo& calm_room() {
  static const RoomVideo room(kCalmStep);
  return room;
}

// What is known about a room, without a model.
StillBackground truth_of(const RoomVideo& room) { return {{}, room.moving, room.depths_behind}; }

// Mean relative error of a mover's depth against the mean depth of the true board.
double depth_error(const RoomVideo& room, const Mover& mover) {
  double error = 0;
  for (size_t k = 0; k < room.depths.size(); ++k) {
    double sum = 0, count = 0;
    for (size_t i = 0; i < room.depths[k].size(); ++i)
      if (room.moving[k].pixels[i]) sum += double(room.depths[k][i]), ++count;
    error += std::fabs(mover.depths[k] * count / sum - 1) / double(room.depths.size());
  }
  return error;
}

TEST(Movers, OneThatBarelyMovesIsWhereItsRaysMeet) {
  const RoomVideo& room = calm_room();
  const auto movers = movers_of(room.video, truth_of(room), neighbour_flows(room.video));
  ASSERT_EQ(movers.size(), 1u);
  EXPECT_EQ(overlap(movers[0].masks, room.moving), 1);
  EXPECT_LT(depth_error(room, movers[0]), 0.05);
}

// The camera moves by 0.09 per frame. The rays of what moves beside it at half of that speed meet
// twice as far away, beyond the wall.
// One that moves further than the camera seems nearly at rest close to it.
class MoversBesideTheCamera : public testing::TestWithParam<double> {};

TEST_P(MoversBesideTheCamera, AreNotBehindWhatTheyHideNorAtTheCamera) {
  const RoomVideo room({GetParam(), 0, 0});
  const auto movers = movers_of(room.video, truth_of(room), neighbour_flows(room.video));
  ASSERT_EQ(movers.size(), 1u);
  for (size_t k = 0; k < room.depths.size(); ++k) {
    std::vector<float> hidden;
    for (size_t i = 0; i < room.depths[k].size(); ++i)
      if (room.moving[k].pixels[i]) hidden.push_back(room.depths_behind[k][i]);
    std::sort(hidden.begin(), hidden.end());
    EXPECT_LT(movers[0].depths[k], double(hidden[hidden.size() / 5])) << k;
    EXPECT_GT(movers[0].depths[k], 0.5 * double(hidden[0])) << k;
  }
}
INSTANTIATE_TEST_SUITE_P(Steps, MoversBesideTheCamera, testing::Values(0.05, 0.12));

TEST(Movers, FewPixelsAreNone) {
  const RoomVideo& room = calm_room();
  StillBackground background = truth_of(room);
  for (Mask& mask : background.moving) mask = Mask(RoomVideo::width, RoomVideo::height);
  background.moving[4].at(10, 10) = 1;
  EXPECT_TRUE(movers_of(room.video, background, neighbour_flows(room.video)).empty());
}

TEST(Movers, PathsStayOnTheBoardAndAreColouredAsIt) {
  const RoomVideo& room = calm_room();
  const NeighbourFlows flows = neighbour_flows(room.video);
  std::vector<Mover> movers = movers_of(room.video, truth_of(room), flows);
  const Paths paths = paths_of(room.video, movers, flows, 300);
  EXPECT_GT(paths.count(), 200u);
  EXPECT_LT(paths.count(), 450u);
  ASSERT_EQ(paths.frames(), size_t(RoomVideo::frames));
  double seen = 0, off = 0;
  for (size_t i = 0; i < paths.count(); ++i) {
    const size_t first = size_t(paths.first_seen[i]);
    EXPECT_TRUE(paths.is_seen(i, first));
    const float* begin = paths.at(i, first);
    for (size_t k = 0; k < paths.frames(); ++k) {
      const float* at = paths.at(i, k);
      // The board only translates, so every point of it does.
      const Eigen::Vector3d moved(double(at[0] - begin[0]), double(at[1] - begin[1]),
                                  double(at[2] - begin[2]));
      const Eigen::Vector3d true_step = kCalmStep * (double(k) - double(first));
      seen += paths.is_seen(i, k);
      off += (moved - true_step).norm();
    }
  }
  const double all = double(paths.count() * paths.frames());
  EXPECT_GT(seen, 0.5 * all);
  EXPECT_LT(off / all, 0.25);  // depth differs over the board by up to 0.8
  for (size_t i = 0; i < paths.count(); ++i) {
    const size_t k = size_t(paths.first_seen[i]);
    const float* at = paths.at(i, k);
    const Eigen::Vector2d pixel =
        room.video.cameras[k].project(Eigen::Vector3f(at[0], at[1], at[2]).cast<double>());
    const size_t index = size_t(pixel.y()) * RoomVideo::width + size_t(pixel.x());
    EXPECT_EQ(paths.rgb[3 * i], room.video.images[k].pixels[3 * index]);
  }
}

}  // namespace
}  // namespace gflow
