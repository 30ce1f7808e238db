// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/similarity.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

using namespace gflow;

namespace {

Camera camera_at(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& position) {
  Camera camera;
  camera.viewmat.topLeftCorner<3, 3>() = rotation.transpose();
  camera.viewmat.topRightCorner<3, 1>() = -rotation.transpose() * position;
  return camera;
}

}  // namespace

TEST(AlignPoints, UndoesAKnownSimilarityEvenForCamerasOnALine) {
  const Eigen::Matrix3d turn(
      Eigen::AngleAxisd(0.7, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix());
  const Eigen::Vector3d shift(3, -2, 1);
  std::vector<Camera> from, to;
  for (int i = 0; i < 3; ++i) {
    const Eigen::Matrix3d own(
        Eigen::AngleAxisd(0.2 * i, Eigen::Vector3d::UnitX()).toRotationMatrix());
    const Eigen::Vector3d position(i, 0, 0);
    from.push_back(camera_at(own, position));
    to.push_back(camera_at(turn * own, 2.5 * turn * position + shift));
  }
  PointCloud points{{1, 2, 3}, {}};
  ASSERT_TRUE(align_points(points, from, to));
  const Eigen::Vector3d expected = 2.5 * turn * Eigen::Vector3d(1, 2, 3) + shift;
  // Stored as float: 6e-8 of values up to 10.
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(points.xyz[size_t(i)], expected[i], 1e-6);
}

TEST(AlignPoints, LeavesPointsWhereCamerasDoNotFit) {
  const Eigen::Matrix3d none = Eigen::Matrix3d::Identity();
  std::vector<Camera> from, to;
  for (int i = 0; i < 3; ++i) {
    from.push_back(camera_at(none, {double(i), 0, 0}));
    to.push_back(camera_at(none, {double(i), double(i * i), 0}));
  }
  PointCloud points{{1, 2, 3}, {}};
  EXPECT_FALSE(align_points(points, from, to));
  EXPECT_FALSE(align_points(points, {from[0]}, {to[0]}));
  EXPECT_FALSE(align_points(points, {from[0], from[0]}, {to[0], to[0]}));
  EXPECT_EQ(points.xyz, (std::vector<double>{1, 2, 3}));
}
