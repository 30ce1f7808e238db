// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/readers/static_camera.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>

#include "optim/scene/readers/reader_util.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace {

void check_orbit(const SceneOptions& options) {
  if (!(std::fabs(options.elevation) < 89.9))
    throw Error(
        fmt::format("scene.elevation is {} degrees, expected -89.9 to 89.9", options.elevation));
  if (!(options.radius > 0) || !std::isfinite(options.radius))
    throw Error(fmt::format("scene.radius is {}, expected a positive number", options.radius));
  if (!(options.fovy > 0 && options.fovy < 180))
    throw Error(fmt::format("scene.fovy is {} degrees, expected 0 to 180", options.fovy));
}

}  // namespace

Camera static_camera(const std::string& name, double azimuth, const SceneOptions& options,
                     int width, int height) {
  check_orbit(options);
  const double el = options.elevation * degree, az = azimuth * degree;
  const Eigen::Vector3d away(std::cos(el) * std::cos(az), std::cos(el) * std::sin(az),
                             std::sin(el));
  Eigen::Matrix3d rotation;
  rotation.col(2) = -away;
  rotation.col(0) = rotation.col(2).cross(Eigen::Vector3d::UnitZ()).normalized();
  rotation.col(1) = rotation.col(2).cross(rotation.col(0));
  Camera camera;
  camera.name = name;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = 0.5 * height / std::tan(0.5 * options.fovy * degree);
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  camera.viewmat = viewmat_from_pose(rotation, options.radius * away, "the camera of " + name);
  return camera;
}

}  // namespace gflow
