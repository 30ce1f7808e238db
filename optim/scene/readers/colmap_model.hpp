// SPDX-License-Identifier: Apache-2.0
// COLMAP models: {cameras,images,points3D}.{bin,txt} of a sparse/0 folder; binary is preferred.
#pragma once
#include <string>
#include <vector>

#include "optim/formats/ply.hpp"
#include "optim/scene/camera.hpp"

namespace gflow {

// One registered picture.
struct ColmapImage {
  std::string name;  // as COLMAP stores it, relative to the picture folder
  Camera camera;     // named like the picture
};

// Cameras and points of a model.
struct ColmapModel {
  std::vector<ColmapImage> images;  // sorted by name
  PointCloud points;
};

// Reads the model in folder. Error when a file is missing, truncated or contradicts another, and
// for a camera model that is not known. Distortion becomes Camera::lens.
ColmapModel read_colmap_model(const std::string& folder);

// Only points3D.{bin,txt} of the folder.
PointCloud read_colmap_points(const std::string& folder);

// True when folder has points3D.bin or .txt.
bool has_colmap_points(const std::string& folder);

}  // namespace gflow
