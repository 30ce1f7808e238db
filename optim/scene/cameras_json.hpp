// SPDX-License-Identifier: Apache-2.0
// cameras.json: the list of cameras that gflow and 3DGS store beside a model.
#pragma once
#include <string>
#include <vector>

#include "optim/scene/camera.hpp"

namespace gflow {

// Reads a cameras.json and divides image sizes by `resolution`. Fields: img_name, width, height,
// position, rotation (camera to world, a list of rows), fx, fy, and cx, cy if the principal point
// is not the image centre, and gflow's near. Error if the file is not such a list.
std::vector<Camera> read_cameras_json(const std::string& path, int resolution);

// The text of a cameras.json.
std::string cameras_json(const std::vector<Camera>& cameras);

// The camera with this name. Error that lists the existing names.
Camera camera_named(const std::vector<Camera>& cameras, const std::string& name);

}  // namespace gflow
