// SPDX-License-Identifier: Apache-2.0
// The similarity between the worlds of two reconstructions, by the cameras that both have.
#pragma once
#include <optional>
#include <vector>

#include "optim/formats/ply.hpp"
#include "optim/scene/camera.hpp"

namespace gflow {

// x -> scale R x + shift.
struct Similarity {
  double scale = 1;
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  double residual = 0;  // of the positions it was fitted to, relative to their spread

  Eigen::Vector3d operator()(const Eigen::Vector3d& point) const {
    return scale * (rotation * point) + shift;
  }
  // The pose (world to camera) that shows the new world as `viewmat` shows the old one.
  Eigen::Matrix4d pose(const Eigen::Matrix4d& viewmat) const;
};

// Maps cameras `from` to `to` (the same in the same order). R is the mean relative rotation, since
// positions on a line or in a plane do not determine it well; scale and shift are a least-squares
// fit of the positions. nullopt for fewer than two distinct positions, or where they disagree.
std::optional<Similarity> similarity_between(const std::vector<Camera>& from,
                                             const std::vector<Camera>& to);

// Applies it to points. Returns true if the positions of the cameras then agree within 5 % of their
// spread; otherwise returns false and leaves the points unchanged.
bool align_points(PointCloud& points, const std::vector<Camera>& from,
                  const std::vector<Camera>& to);

}  // namespace gflow
