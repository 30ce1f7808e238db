// SPDX-License-Identifier: Apache-2.0
// Depth files beside the images: true depth for evaluation, measured or estimated depth for
// training (setting scene.depth says which).
#pragma once
#include <string>
#include <vector>

#include "optim/scene/scene.hpp"

namespace gflow {

// The depth file BASE.npy or BASE.png; empty if there is none.
std::string find_depth(const std::string& base);

// Sets Frame::depth_path of frames that have none yet: the file in depth/ of the scene's folder
// with the name of the image, with or without the folders that contain it (images/a/1.jpg:
// depth/images/a/1.npy, depth/a/1.npy or depth/1.npy).
void find_depth_files(Scene& scene);

// Whether a frame's depth file is true depth, which evaluation compares with.
inline bool has_true_depth(const Frame& frame, const SceneOptions& options) {
  return !frame.depth_path.empty() && options.depth == DepthFiles::metric;
}

// Values of a frame's depth file at the pixels of its image, as the pinhole camera sees it
// (FrameStore), in a size of [height, width]: depth along the camera's z axis, or disparity, as
// options.depth says. Nearest samples, because averaging across a silhouette gives a depth of no
// surface. 0: no surface. Integers (PNG, .npy) are multiplied by options.depth_unit if they are
// metric. Error if the frame has no file, or it is not such an array or grey image, or has another
// aspect ratio than the image. camera: of the stored image (Scene::cameras).
std::vector<float> read_depth_map(const Frame& frame, const Camera& camera, int width, int height,
                                  const SceneOptions& options);

}  // namespace gflow
