// SPDX-License-Identifier: Apache-2.0
// Correction of a pose by small numbers.
#pragma once
#include <Eigen/Geometry>

namespace gflow {

// Of a world-to-camera pose. It turns about the point on the camera's axis at `depth`, the middle
// of what the camera sees, since a turn about the camera itself looks almost like a shift.
struct CameraCorrection {
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();   // axis times angle, in camera axes [rad]
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();  // in camera axes [x depth]

  // turn, shift.
  static CameraCorrection of(const Eigen::Matrix<double, 6, 1>& x) {
    return {x.head<3>(), x.tail<3>()};
  }
  // The corrected pose.
  Eigen::Matrix4d applied(const Eigen::Matrix4d& viewmat, double depth) const {
    const Eigen::Vector3d pivot(0, 0, depth);
    Eigen::Isometry3d move = Eigen::Isometry3d::Identity();
    move.translate(depth * shift + pivot);
    if (turn.norm() > 0) move.rotate(Eigen::AngleAxisd(turn.norm(), turn.normalized()));
    move.translate(-pivot);
    return move.matrix() * viewmat;
  }
};

}  // namespace gflow
