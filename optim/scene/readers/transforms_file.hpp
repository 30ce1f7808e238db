// SPDX-License-Identifier: Apache-2.0
// Transforms files of Blender/D-NeRF and nerfstudio: a list of frames, each with file_path and
// transform_matrix, optionally time and mask_path; intrinsics (camera_angle_x, camera_angle_y, or
// fl_x, fl_y, cx, cy, w, h) and distortion for all frames or per frame. Square pixels if only one
// focal length is given.
#pragma once
#include <string>
#include <vector>

#include "optim/scene/json_file.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// A transforms file; its path is for errors.
struct Transforms {
  std::string path;
  Json json;  // an object with a list 'frames'
};

Transforms read_transforms(const std::string& path);

// Whether the frames have a 'time'.
bool has_times(const Transforms& file);

// Reads the frames in the order of the file and adds their cameras to the scene. Paths are relative
// to `folder`; an image's extension may be omitted. Time is 0 if absent, and may exceed 1
// (normalise_times). Frames without an image or with a pose that is not finite are left out, with a
// notice. Error if these are more than half, or if a frame lacks its pose or intrinsics.
std::vector<Frame> read_frames(const std::string& folder, const Transforms& file,
                               const SceneOptions& options, Scene& scene);

// Scales the times of all frames together to [0, 1], with a notice, if any exceeds 1: seconds or
// frame numbers. `source` names the files.
void normalise_times(const std::vector<std::vector<Frame>*>& splits, const std::string& source,
                     std::vector<std::string>& notices);

// Initial points of a scene whose poses are in transforms files: find_points_ply, else those of a
// COLMAP model (find_sparse), in the world of the frames. `source` names the files.
PointCloud points_beside(const std::string& folder, const std::string& source, Scene& scene);

// Reads only the cameras, in the order of the file, scaled to this size. Each is named by its
// file_path, which need not exist, if it has one. `image` is the image of this size, for errors.
std::vector<Camera> read_cameras(const Transforms& file, int width, int height,
                                 const std::string& image, std::vector<std::string>& notices);

}  // namespace gflow
