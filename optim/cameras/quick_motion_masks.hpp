// SPDX-License-Identifier: Apache-2.0
// What moves in the frames of a moving camera, from optical flow and colours, without training.
#pragma once
#include "optim/cameras/suspects.hpp"

namespace gflow {

// One mask per frame. A pixel moves if it is a suspect (suspects.hpp) and its colour differs from
// that of the points at rest of all frames that project there, or none do. progress: in frames.
std::vector<Mask> quick_motion_masks(const SmallVideo& video, const ProgressCallback& progress);

}  // namespace gflow
