// SPDX-License-Identifier: Apache-2.0
// What moves in the training frames of a moving camera.
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "optim/cameras/masks.hpp"
#include "optim/images/rect.hpp"
#include "optim/scene/frame_store.hpp"

namespace gflow {

// By the names of frames, in order of time; may be smaller than the images.
using MotionMasks = std::vector<std::pair<std::string, Mask>>;

// FOLDER/<name>.png: 255 where something moves, in the size of the mask.
void write_motion_masks(const std::string& folder, const MotionMasks& masks);
// The same of the training frames of a scene; empty if a file is missing or is no image.
MotionMasks read_motion_masks(const std::string& folder, const Scene& scene);

// Focus region of each training frame (init/motion_mask.hpp).
std::vector<Rect> parts_around(const Scene& scene, const FrameStore& store,
                               const MotionMasks& masks);

}  // namespace gflow
