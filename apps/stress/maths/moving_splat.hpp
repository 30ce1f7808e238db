// SPDX-License-Identifier: Apache-2.0
// One moving Gaussian before a pinhole camera with a focal length of 1000 px: the true motion of
// its material points against a transport.
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
// A rotation by `degrees` about an axis.
inline Matrix3d turn(const Vector3d& axis, double degrees) {
  return Eigen::AngleAxisd(degrees * 3.14159265358979323846 / 180, axis.normalized())
      .toRotationMatrix();
}

// Root mean squares [px] over pixels sampled from the splat's density, |z| <= 3.
struct FlowErrors {
  double flow;       // the true flow
  double error;      // error of the device's flow
  double translate;  // error of mu2 - mu1 for every pixel
  double spread;     // sqrt(p^2 + q^2) of the splat's standard deviations p, q
};

// True flow: the point of highest density on the pixel's ray moves with the affine 3D motion.
FlowErrors flow_errors(DeviceMaths& device, int mode, const Pose& at_t1, const Pose& at_t2);

}  // namespace gflow::stress
