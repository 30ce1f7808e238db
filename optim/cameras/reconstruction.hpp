// SPDX-License-Identifier: Apache-2.0
// Structure from motion for one moving camera: poses of all frames, its focal length, and points of
// the static world, from feature tracks. What moves in the world contradicts it and is left out.
#pragma once
#include <string>

#include "optim/cameras/bundle.hpp"
#include "runtime/base/report.hpp"

namespace gflow {

struct ReconstructionOptions {
  int frames = 0, width = 0, height = 0;  // [px]
  double focal = 0;                       // [px]; 0: estimated
  bool radial = false;                    // estimate radial distortion
  ProgressCallback progress;              // in frames placed
};

// Error if the camera does not move, or only turns; the sentence says so.
CameraPath reconstruct(const std::vector<FeatureTrack>& tracks,
                       const ReconstructionOptions& options);

// Adjusts poses that are right to a few degrees, one for each frame, and the lens to the tracks.
// World and scale stay those of the poses, on average.
CameraPath adjusted(const std::vector<FeatureTrack>& tracks, const SharedLens& lens,
                    const std::vector<Eigen::Isometry3d>& poses,
                    const ReconstructionOptions& options);

// How far the observations in use are from the projections [px].
struct ReprojectionStatistics {
  double median = 0, mean = 0;
  size_t observations = 0, points = 0, rejected = 0;
};
ReprojectionStatistics statistics_of(const std::vector<FeatureTrack>& tracks,
                                     const CameraPath& path);

}  // namespace gflow
