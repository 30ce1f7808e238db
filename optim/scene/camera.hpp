// SPDX-License-Identifier: Apache-2.0
// The pinhole camera that all readers produce. Pixel (i, j) has its centre at (i + .5, j + .5), x
// right, y down. A point with camera coordinates (x, y, z), z > 0, projects to (fx x / z + cx, fy y
// / z + cy).
#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

namespace gflow {

constexpr double degree = M_PI / 180;  // [rad]

// Lens distortion of a camera's stored images; formulas are in optim/scene/lens.hpp.
struct Lens {
  enum class Kind { none, radial, fisheye };
  Kind kind = Kind::none;
  std::array<double, 8> k = {};           // radial: k1 k2 p1 p2 k3 k4 k5 k6; fisheye: k1 k2 k3 k4
  double fx = 0, fy = 0, cx = 0, cy = 0;  // of the stored image [px]; 0 without a lens

  bool operator==(const Lens& other) const {
    return kind == other.kind && k == other.k && fx == other.fx && fy == other.fy &&
           cx == other.cx && cy == other.cy;
  }
};

// A physical camera, or one pose of a moving camera.
struct Camera {
  std::string name;                                       // e.g. cam03
  int width = 0, height = 0;                              // [px]
  double fx = 0, fy = 0, cx = 0, cy = 0;                  // [px]
  Eigen::Matrix4d viewmat = Eigen::Matrix4d::Identity();  // world to camera, OpenCV axes

  Lens lens;        // FrameStore removes its effect from the images
  double near = 0;  // Gaussians nearer are not drawn [scene units]; 0: cameras.json does not say

  // Camera centre in world coordinates.
  Eigen::Vector3d position() const {
    return -viewmat.topLeftCorner<3, 3>().transpose() * viewmat.topRightCorner<3, 1>();
  }

  // Pixel coordinates of a world point in front of the camera.
  Eigen::Vector2d project(const Eigen::Vector3d& world) const {
    const Eigen::Vector3d p =
        viewmat.topLeftCorner<3, 3>() * world + viewmat.topRightCorner<3, 1>();
    return {fx * p.x() / p.z() + cx, fy * p.y() / p.z() + cy};
  }

  // World direction of the points that project to a pixel, with length 1 along the axis.
  Eigen::Vector3d ray(const Eigen::Vector2d& pixel) const {
    return viewmat.topLeftCorner<3, 3>().transpose() *
           Eigen::Vector3d((pixel.x() - cx) / fx, (pixel.y() - cy) / fy, 1);
  }

  // Depth of a world point that is in front of the camera and inside its image; nullopt for others.
  std::optional<double> depth_in_view(const Eigen::Vector3d& world) const {
    const double z = viewmat.row(2).dot(world.homogeneous());
    if (!(z > 0)) return std::nullopt;
    const Eigen::Vector2d pixel = project(world);
    const bool inside = pixel.x() >= 0 && pixel.x() < width && pixel.y() >= 0 && pixel.y() < height;
    return inside ? std::optional(z) : std::nullopt;
  }

  // Jacobian of project() with respect to the point [px / scene unit].
  Eigen::Matrix<double, 2, 3> derivative(const Eigen::Vector3d& world) const {
    const Eigen::Matrix3d r = viewmat.topLeftCorner<3, 3>();
    const Eigen::Vector3d p = r * world + viewmat.topRightCorner<3, 1>();
    Eigen::Matrix<double, 2, 3> j;
    j.row(0) = fx / p.z() * (r.row(0) - p.x() / p.z() * r.row(2));
    j.row(1) = fy / p.z() * (r.row(1) - p.y() / p.z() * r.row(2));
    return j;
  }
};

// Mean of the cameras' upward axes in the world, unit; nullopt if they have none in common.
inline std::optional<std::array<double, 3>> mean_up(const std::vector<Camera>& cameras) {
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const Camera& camera : cameras) up -= camera.viewmat.block<1, 3>(1, 0).transpose();
  if (!(up.norm() > 1e-3 * double(cameras.size()))) return std::nullopt;
  up.normalize();
  return std::array<double, 3>{up.x(), up.y(), up.z()};
}

// The camera of an image that is resized.
inline Camera resized(Camera camera, int width, int height) {
  const double sx = double(width) / camera.width, sy = double(height) / camera.height;
  camera.width = width;
  camera.height = height;
  camera.fx *= sx;
  camera.cx *= sx;
  camera.fy *= sy;
  camera.cy *= sy;
  return camera;
}

// The same for an image reduced by `divisor`; sizes round down but are at least 1, as for images.
inline Camera reduced(const Camera& camera, int divisor) {
  return resized(camera, std::max(1, camera.width / divisor), std::max(1, camera.height / divisor));
}

// And for one whose longer side has at most `most` pixels.
inline Camera limited(const Camera& camera, int most) {
  const double scale = std::min(1.0, double(most) / std::max(camera.width, camera.height));
  return resized(camera, std::max(1, int(std::lround(scale * camera.width))),
                 std::max(1, int(std::lround(scale * camera.height))));
}

}  // namespace gflow
