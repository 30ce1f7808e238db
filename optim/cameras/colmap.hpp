// SPDX-License-Identifier: Apache-2.0
// Poses by the program COLMAP, if it is installed. It also matches photographs that were not taken
// one after the other, which feature tracks cannot.
#pragma once
#include <string>

#include "optim/cameras/colmap_tracks.hpp"
#include "optim/scene/loaded_scene.hpp"

namespace gflow {

struct ColmapOptions {
  double focal = 0;      // [px]; 0: estimated
  bool radial = false;   // estimate radial distortion
  bool quiet = false;    // no progress lines
  std::string kept_log;  // file that receives COLMAP's output if it fails
};

struct ColmapResult {
  TrackedPath found;
  std::string log;  // COLMAP's output
};

// Runs COLMAP, on the CPU, on the frames of a video or a folder of images. All pairs of a folder of
// at most 200 images are matched, else only neighbours in time. If COLMAP ends up with several
// models, the result is the largest, with a warning. Error if it is not on PATH, fails or places no
// frame; Interrupted after a signal.
ColmapResult reconstruct_with_colmap(const LoadedScene& video, const ColmapOptions& options);

}  // namespace gflow
