// SPDX-License-Identifier: Apache-2.0
#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>

#include "optim/scene/similarity.hpp"

namespace gflow {
namespace {

Eigen::Vector3d mean_position(const std::vector<Camera>& cameras) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Camera& camera : cameras) sum += camera.position();
  return sum / double(cameras.size());
}

// The rotation nearest to the sum of R_to^T R_from (orthogonal Procrustes).
Eigen::Matrix3d mean_rotation(const std::vector<Camera>& from, const std::vector<Camera>& to) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (size_t i = 0; i < from.size(); ++i)
    sum += to[i].viewmat.topLeftCorner<3, 3>().transpose() * from[i].viewmat.topLeftCorner<3, 3>();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d u = svd.matrixU();
  if ((u * svd.matrixV().transpose()).determinant() < 0) u.col(2) *= -1;
  return u * svd.matrixV().transpose();
}

}  // namespace

Eigen::Matrix4d Similarity::pose(const Eigen::Matrix4d& viewmat) const {
  const Eigen::Matrix3d turn = viewmat.topLeftCorner<3, 3>() * rotation.transpose();
  Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
  pose.topLeftCorner<3, 3>() = turn;
  pose.topRightCorner<3, 1>() = scale * viewmat.topRightCorner<3, 1>() - turn * shift;
  return pose;
}

std::optional<Similarity> similarity_between(const std::vector<Camera>& from,
                                             const std::vector<Camera>& to) {
  if (from.size() != to.size() || from.size() < 2) return std::nullopt;
  Similarity map;
  map.rotation = mean_rotation(from, to);
  const Eigen::Vector3d from_mean = mean_position(from), to_mean = mean_position(to);
  double product = 0, from_square = 0, to_square = 0;
  for (size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector3d a = map.rotation * (from[i].position() - from_mean);
    const Eigen::Vector3d b = to[i].position() - to_mean;
    product += a.dot(b);
    from_square += a.squaredNorm();
    to_square += b.squaredNorm();
  }
  if (!(product > 0)) return std::nullopt;
  // Least squares: s = <a, b> / <a, a>; the squared residual is <b, b> - s <a, b>.
  map.scale = product / from_square;
  map.shift = to_mean - map.scale * (map.rotation * from_mean);
  map.residual = std::sqrt(std::max(0., to_square - map.scale * product) / to_square);
  return map;
}

bool align_points(PointCloud& points, const std::vector<Camera>& from,
                  const std::vector<Camera>& to) {
  const auto map = similarity_between(from, to);
  if (!map || !(map->residual <= 0.05)) return false;
  for (size_t i = 0; i < points.size(); ++i) {
    Eigen::Map<Eigen::Vector3d> p(&points.xyz[3 * i]);
    p = (*map)(p);
  }
  return true;
}

}  // namespace gflow
