// SPDX-License-Identifier: Apache-2.0
// Lists of cameras as runs of gflow and of 3DGS have them beside the model: cameras.json.
#pragma once
#include <string>
#include <vector>

#include "optim/scene/camera.hpp"

namespace gflow {

// Cameras in a cameras.json, reduced by `resolution`: img_name, width, height, position, rotation
// (camera to world, a list of rows), fx, fy, and cx, cy where they are not the middle. Error when
// it is no such list.
std::vector<Camera> read_cameras_json(const std::string& path, int resolution);

// The text of such a file.
std::string cameras_json(const std::vector<Camera>& cameras);

// The camera of that name. Error that lists the names there are.
Camera camera_named(const std::vector<Camera>& cameras, const std::string& name);

}  // namespace gflow
