// SPDX-License-Identifier: Apache-2.0
// Writes a video whose camera is known as a scene folder: images/, transforms.json (nerfstudio,
// with times; gflow reads this), sparse/0 (COLMAP, text), points3D.ply, cameras.json.
#pragma once
#include <string>

#include "optim/cameras/bundle.hpp"
#include "optim/scene/loaded_scene.hpp"
#include "runtime/base/report.hpp"

namespace gflow {

// Name of the image of a frame, "00012.png".
std::string image_name(size_t frame);

// Frame k of the video has pose k of the path, and is left out without.
// Images are stored as PNG. The folder is made; files in it are replaced. progress: in images.
void write_camera_scene(const std::string& folder, const LoadedScene& video,
                        const std::vector<FeatureTrack>& tracks, const CameraPath& path,
                        const ProgressCallback& progress);

}  // namespace gflow
