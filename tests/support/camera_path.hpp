// SPDX-License-Identifier: Apache-2.0
// Cameras that move, as truth for estimated ones, and their comparison up to a similarity.
#pragma once
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <vector>

#include "optim/images/image.hpp"
#include "optim/scene/camera.hpp"

namespace gflow {

// Camera k of n on an arc of 60 degrees and radius 5 around the origin, 1.5 above it, looking at a
// point near it. World z is up.
inline Eigen::Isometry3d pose_on_arc(int k, int n) {
  const double share = n > 1 ? double(k) / (n - 1) : 0, angle = (share - 0.5) * 60 * degree;
  const Eigen::Vector3d eye(5 * std::sin(angle), -5 * std::cos(angle),
                            1.5 + 0.1 * std::sin(9 * share));
  const Eigen::Vector3d target(0.2 * std::sin(7 * share), 0, 0.3);
  Eigen::Matrix3d axes;  // of the camera, in the world
  axes.col(2) = (target - eye).normalized();
  axes.col(0) = axes.col(2).cross(Eigen::Vector3d::UnitZ()).normalized();
  axes.col(1) = axes.col(2).cross(axes.col(0));
  Eigen::Isometry3d camera_to_world = Eigen::Isometry3d::Identity();
  camera_to_world.linear() = axes;
  camera_to_world.translation() = eye;
  return camera_to_world.inverse();
}

// Errors of poses (world to camera) after the best similarity.
struct PoseErrors {
  double place = 0;  // root mean square, as a share of the length of the true path
  double angle = 0;  // median [degrees]
};

inline PoseErrors compare_poses(const std::vector<Eigen::Isometry3d>& found,
                                const std::vector<Eigen::Isometry3d>& truth) {
  const size_t n = truth.size();
  Eigen::Matrix3Xd from(3, n), to(3, n);
  Eigen::Matrix3d turns = Eigen::Matrix3d::Zero();
  double length = 0;
  for (size_t k = 0; k < n; ++k) {
    from.col(long(k)) = found[k].inverse().translation();
    to.col(long(k)) = truth[k].inverse().translation();
    if (k > 0) length += (to.col(long(k)) - to.col(long(k) - 1)).norm();
    turns += truth[k].rotation().transpose() * found[k].rotation();
  }
  const Eigen::Matrix4d similarity = Eigen::umeyama(from, to, true);
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(turns, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d turn = svd.matrixU() * svd.matrixV().transpose();
  PoseErrors errors;
  std::vector<double> angles;
  for (size_t k = 0; k < n; ++k) {
    const Eigen::Vector3d moved = (similarity * from.col(long(k)).homogeneous()).head<3>();
    errors.place += (moved - to.col(long(k))).squaredNorm() / double(n);
    const Eigen::Matrix3d left =
        found[k].rotation() * turn.transpose() * truth[k].rotation().transpose();
    angles.push_back(Eigen::AngleAxisd(left).angle() / degree);
  }
  errors.place = std::sqrt(errors.place) / length;
  std::nth_element(angles.begin(), angles.begin() + long(n / 2), angles.end());
  errors.angle = angles[n / 2];
  return errors;
}

// A smooth random texture, -1 to 1, of about one feature per unit.
inline double texture_at(double u, double v, int seed) {
  double sum = 0;
  for (int k = 0; k < 6; ++k) {
    const double a = 1.7 * k + seed, f = 1.5 + 0.9 * k;
    sum += std::sin(f * (u * std::cos(a) + v * std::sin(a)) + 5 * a);
  }
  return sum / 3.5;
}

// What a camera sees of a room, per pixel: depth along the axis, and 1 where the last board is.
struct RoomTruth {
  std::vector<float> depth;
  std::vector<uint8_t> last;
};

// What a camera sees of a room: a floor, a wall behind, and before it two textured boards, the last
// one displaced by `moved`. without_last: as if it were not there.
inline Image image_of_room(const Eigen::Isometry3d& pose, double focal, int width, int height,
                           const Eigen::Vector3d& moved = Eigen::Vector3d::Zero(),
                           RoomTruth* truth = nullptr, bool without_last = false) {
  struct Board {
    Eigen::Vector3d corner, u, v;  // sides of length 1
    double wide, high;
    int seed;
  };
  static const std::vector<Board> boards = {
      {{-20, -6, 0}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), 40, 9, 1},
      {{-20, 3, 0}, Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitZ(), 40, 15, 2},
      {{-1.6, 0.6, 0}, {0.8, 0.6, 0}, Eigen::Vector3d::UnitZ(), 1.2, 1.4, 3},
      {{0.5, -0.4, 0}, {0.6, -0.8, 0}, Eigen::Vector3d::UnitZ(), 1, 0.9, 4}};
  const Eigen::Isometry3d eye = pose.inverse();
  Image image{width, height, 3, {}};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const Eigen::Vector3d ray =
          eye.rotation() *
          Eigen::Vector3d((x + .5 - .5 * width) / focal, (y + .5 - .5 * height) / focal, 1);
      double nearest = 1e9, nearest_u = 0, nearest_v = 0;
      const Board* seen = nullptr;
      for (const Board& board : boards) {
        const bool last = &board == &boards.back();
        if (last && without_last) continue;
        const Eigen::Vector3d corner = last ? Eigen::Vector3d(board.corner + moved) : board.corner;
        const Eigen::Vector3d normal = board.u.cross(board.v);
        const double depth = normal.dot(corner - eye.translation()) / normal.dot(ray);
        const Eigen::Vector3d on = eye.translation() + depth * ray - corner;
        const double u = on.dot(board.u), v = on.dot(board.v);
        if (!(depth > 0.1 && depth < nearest) || u < 0 || v < 0 || u > board.wide || v > board.high)
          continue;
        nearest = depth, nearest_u = u, nearest_v = v;
        seen = &board;
      }
      const double level = seen ? texture_at(2.5 * nearest_u, 2.5 * nearest_v, seen->seed) : 0;
      const auto value = uint8_t(std::clamp(128 + 90 * level, 0., 255.));
      image.pixels.insert(image.pixels.end(), {value, value, value});
      if (truth)
        truth->depth.push_back(float(nearest)), truth->last.push_back(seen == &boards.back());
    }
  return image;
}

}  // namespace gflow
