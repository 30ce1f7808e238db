// SPDX-License-Identifier: Apache-2.0
// True depth of a scene, for evaluation only.
#pragma once
#include <vector>

#include "optim/scene/scene.hpp"

namespace gflow {

// True depth of a frame (Frame::depth_path, .npy [H, W]) along the camera's z axis [scene units],
// resized to [height, width] by the nearest sample, because averaging across a silhouette gives a
// depth of no surface. 0: no surface. Error if the frame has none, or the file is not such an array
// or has another aspect ratio than the image.
std::vector<float> read_true_depth(const Frame& frame, int width, int height);

}  // namespace gflow
