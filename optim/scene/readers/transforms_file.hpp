// SPDX-License-Identifier: Apache-2.0
// Transforms files, as Blender/D-NeRF and nerfstudio have them: a list of frames, each with
// file_path and transform_matrix, optionally time and mask_path; intrinsics (camera_angle_x, or
// fl_x, fl_y, cx, cy, w, h) and distortion for all or each frame.
#pragma once
#include <string>
#include <vector>

#include "optim/scene/json_file.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// A transforms file and where it is, for errors.
struct Transforms {
  std::string path;
  Json json;  // an object with a list 'frames'
};

Transforms read_transforms(const std::string& path);

// The frames in the order of the file; their cameras are added to the scene. Paths are relative to
// `folder`; a picture's extension may be left out. Time is 0 where a frame has none. Error when a
// picture is missing or a frame lacks its pose or intrinsics.
std::vector<Frame> read_frames(const std::string& folder, const Transforms& file,
                               const SceneOptions& options, Scene& scene);

// The cameras of the frames alone, in the order of the file, scaled to a size; called as their
// file_path, which need not exist. `picture` is what has that size, for errors.
std::vector<Camera> read_cameras(const Transforms& file, int width, int height,
                                 const std::string& picture);

}  // namespace gflow
