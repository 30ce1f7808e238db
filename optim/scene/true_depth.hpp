// SPDX-License-Identifier: Apache-2.0
// A scene's own depth, for judging only.
#pragma once
#include <vector>

#include "optim/scene/scene.hpp"

namespace gflow {

// True depth of a frame (Frame::depth_path, .npy [H, W]) along the camera's z axis [scene units] at
// width x height, [height, width]; on a smaller grid the nearest sample, since a mean across a
// silhouette is the depth of nothing. 0: no surface. Error when the frame has none, and when the
// file is no such array or of another shape than the picture.
std::vector<float> read_true_depth(const Frame& frame, int width, int height);

}  // namespace gflow
