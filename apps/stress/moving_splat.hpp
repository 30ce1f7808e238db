// SPDX-License-Identifier: Apache-2.0
// One Gaussian that moves before a pinhole camera of 1000 px: where its material points go, and
// what a transport says instead (numerics 1.5).
#pragma once
#include <Eigen/Geometry>

#include "apps/stress/device_maths.hpp"

namespace gflow::stress {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

// A Gaussian's pose: mean, and L = R diag(scales).
struct Pose {
  Vector3d mean;
  Matrix3d factor;
};
inline Pose pose(const Vector3d& mean, const Matrix3d& rotation, const Vector3d& scales) {
  return {mean, rotation * scales.asDiagonal()};
}
// A turn by `degrees` about an axis.
inline Matrix3d turn(const Vector3d& axis, double degrees) {
  return Eigen::AngleAxisd(degrees * 3.14159265358979323846 / 180, axis.normalized())
      .toRotationMatrix();
}

// Of pixels drawn from the splat's own density, |z| <= 3, root mean squares [px].
struct FlowErrors {
  double flow;       // of the true flow itself
  double error;      // of the device's flow
  double translate;  // of mu2 - mu1 for every pixel
  double spread;     // standard deviations p, q of the splat: sqrt(p^2 + q^2)
};

// True flow: the point of highest density on the pixel's ray goes where the 3D affine motion takes
// it.
FlowErrors flow_errors(DeviceMaths& device, int mode, const Pose& at_t1, const Pose& at_t2);

}  // namespace gflow::stress
