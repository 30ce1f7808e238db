// SPDX-License-Identifier: Apache-2.0
// The scene layouts, one reader and one recogniser each; read_scene asks them in turn.
#pragma once
#include <string>

#include "optim/data/scene.hpp"

namespace gflow {

// D-NeRF / Blender: transforms_train.json, optionally transforms_{test,val}.json. OpenGL
// camera-to-world matrices, times in [0, 1] (0 when absent), intrinsics for all or each frame. What
// belongs to one moving camera is found by find_tracks.
bool is_blender(const std::string& folder);
Scene read_blender(const std::string& folder, const SceneOptions& options);

// Plenoptic video / N3V: poses_bounds.npy with camNN/images/ (preferred) or camNN.mp4, or with one
// picture a camera in images/ or images_N/: options.images, else the smallest size that is there
// (the greatest N). Camera options.holdout becomes the test camera. Points of a COLMAP model with
// as many pictures as there are cameras are aligned to the poses, and left out when that fails.
bool is_n3v(const std::string& folder);
Scene read_n3v(const std::string& folder, const SceneOptions& options);

// Consistent4D: numbered RGBA pictures of one static camera in the folder itself or in input/,
// with test views in eval_0 ... eval_3 at azimuths -75, 15, 105 and 195 degrees. Without those the
// input view is the test view.
bool is_consistent4d(const std::string& folder);
Scene read_consistent4d(const std::string& folder, const SceneOptions& options);

// COLMAP: sparse/0/ and a picture folder (options.images, else images). A static scene, one step.
bool is_colmap(const std::string& folder);
Scene read_colmap(const std::string& folder, const SceneOptions& options);

}  // namespace gflow
