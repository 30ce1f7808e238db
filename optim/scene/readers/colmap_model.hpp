// SPDX-License-Identifier: Apache-2.0
// COLMAP models: {cameras,images,points3D}.{bin,txt} of a sparse/0 folder; binary is preferred.
#pragma once
#include <string>
#include <vector>

#include "optim/formats/ply.hpp"
#include "optim/scene/camera.hpp"

namespace gflow {

// One registered image.
struct ColmapImage {
  std::string name;  // relative to the image folder, with_slashes
  Camera camera;     // has the image's name
};

// Cameras and points of a model.
struct ColmapModel {
  std::vector<ColmapImage> images;  // sorted by name
  PointCloud points;
};

// Reads the model in a folder; distortion becomes Camera::lens. Error if a file is missing,
// truncated or contradicts another, or if a camera model is unknown.
ColmapModel read_colmap_model(const std::string& folder);

// Reads only points3D.{bin,txt} of a folder.
PointCloud read_colmap_points(const std::string& folder);

// Whether a folder has points3D.bin or .txt.
bool has_colmap_points(const std::string& folder);

}  // namespace gflow
