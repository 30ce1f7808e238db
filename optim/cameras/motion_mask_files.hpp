// SPDX-License-Identifier: Apache-2.0
// Masks of what moves, beside the images of a scene.
#pragma once
#include <string>

#include "optim/cameras/bundle.hpp"
#include "optim/scene/loaded_scene.hpp"
#include "runtime/base/report.hpp"

namespace gflow {

// Not masks/: readers of scenes would take what moves for pixels to leave out.
inline constexpr const char* kMotionMasks = "motion_masks";

// Writes a mask for each frame of the video that has a pose, with the name and size of its image in
// the scene (camera_scene.hpp): black where something moves, else white. Returns the share of
// pixels that move. progress: in frames.
double write_motion_mask_files(const std::string& folder, const LoadedScene& video,
                               const CameraPath& path, const ProgressCallback& progress);

}  // namespace gflow
