// SPDX-License-Identifier: Apache-2.0
#include "optim/guidance/orbit.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace gflow {
namespace {

// Two orthonormal directions perpendicular to `up`; azimuth is measured from the first to the
// second.
std::pair<Eigen::Vector3d, Eigen::Vector3d> across(const Eigen::Vector3d& up) {
  const Eigen::Vector3d some =
      std::fabs(up.x()) < 0.9 ? Eigen::Vector3d::UnitX().eval() : Eigen::Vector3d::UnitY().eval();
  const Eigen::Vector3d first = (some - some.dot(up) * up).normalized();
  return {first, up.cross(first)};
}

}  // namespace

OrbitPosition place_of(const Orbit& orbit, const Camera& camera) {
  const Eigen::Vector3d away = camera.position() - orbit.focus;
  const auto [first, second] = across(orbit.up);
  OrbitPosition place;
  place.distance = away.norm();
  place.azimuth = std::atan2(away.dot(second), away.dot(first)) / degree;
  const double height = place.distance > 0 ? away.dot(orbit.up) / place.distance : 0;
  place.elevation = std::asin(std::clamp(height, -1.0, 1.0)) / degree;
  return place;
}

Camera moved(const Orbit& orbit, Camera camera, double azimuth, double elevation) {
  const OrbitPosition from = place_of(orbit, camera);
  constexpr double steepest = 89;
  // A camera that is already higher is limited to its own elevation.
  const double most = std::max(steepest, std::fabs(from.elevation));
  const double rise = std::clamp(from.elevation + elevation, -most, most) - from.elevation;
  const auto [first, second] = across(orbit.up);
  const Eigen::Vector3d outwards =
      std::cos(from.azimuth * degree) * first + std::sin(from.azimuth * degree) * second;
  const Eigen::Matrix3d turn = (Eigen::AngleAxisd(azimuth * degree, orbit.up) *
                                Eigen::AngleAxisd(rise * degree, outwards.cross(orbit.up)))
                                   .toRotationMatrix();
  const Eigen::Vector3d position = orbit.focus + turn * (camera.position() - orbit.focus);
  const Eigen::Matrix3d rotation = camera.viewmat.topLeftCorner<3, 3>() * turn.transpose();
  camera.viewmat.topLeftCorner<3, 3>() = rotation;
  camera.viewmat.topRightCorner<3, 1>() = -rotation * position;
  return camera;
}

OrbitPosition difference(const OrbitPosition& a, const OrbitPosition& b) {
  return {std::remainder(b.azimuth - a.azimuth, 360.0), b.elevation - a.elevation,
          b.distance - a.distance};
}

Camera squared(Camera camera, int size) {
  if (size == 0) return camera;
  const double scale = double(size) / std::max(camera.width, camera.height);
  camera.fx *= scale;
  camera.fy *= scale;
  camera.cx = 0.5 * size + scale * (camera.cx - 0.5 * camera.width);
  camera.cy = 0.5 * size + scale * (camera.cy - 0.5 * camera.height);
  camera.width = camera.height = size;
  return camera;
}

}  // namespace gflow
