// SPDX-License-Identifier: Apache-2.0
// Bundle adjustment of one camera that moves, by Ceres: poses, points and the lens that make the
// points project to where they were seen.
#pragma once
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "optim/cameras/feature_tracks.hpp"

namespace gflow {

// What all frames share. A camera point (x, y, z) is seen at centre + focal d (x, y) / z with
// d = 1 + k1 r^2, r^2 = (x^2 + y^2) / z^2.
struct SharedLens {
  double focal = 0;        // [px]
  double k1 = 0;           // radial distortion
  Eigen::Vector2d centre;  // principal point [px]

  Eigen::Vector2d project(const Eigen::Vector3d& in_camera) const {
    const Eigen::Vector2d p = in_camera.head<2>() / in_camera.z();
    return centre + focal * (1 + k1 * p.squaredNorm()) * p;
  }
  // The direction (x, y, 1) that is seen at a pixel.
  Eigen::Vector3d unproject(const Eigen::Vector2d& pixel) const;
};

// A camera that moves through a world of fixed points.
struct CameraPath {
  SharedLens lens;
  std::vector<std::optional<Eigen::Isometry3d>> poses;  // world to camera; nullopt: not placed
  // One per feature track; nullopt: its place is not known, or it is not at rest.
  std::vector<std::optional<Eigen::Vector3d>> points;
  // [tracks][points of the track]: observations that contradict the others are not used.
  std::vector<std::vector<bool>> used;
};

struct BundleOptions {
  bool refine_focal = true, refine_k1 = false;
  bool refine_points = true;
  double robust_px = 1;  // knee of the Cauchy loss [px]
  int iterations = 30;
  std::vector<bool> fixed;  // frames whose poses stay; empty: the first placed one
  std::vector<bool> with;   // frames whose observations count; empty: all placed ones
};

// Mean robust error [px^2] after refinement. Poses, points and lens of `path` are refined in place.
double adjust_bundle(const std::vector<FeatureTrack>& tracks, const BundleOptions& options,
                     CameraPath& path);

}  // namespace gflow
