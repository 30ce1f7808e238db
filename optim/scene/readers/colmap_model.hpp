// SPDX-License-Identifier: Apache-2.0
// COLMAP models: {cameras,images,points3D}.{bin,txt} in a folder; binary is preferred.
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

// Whether a folder has the cameras and images of a model.
bool is_colmap_model(const std::string& folder);

// The folder of the model in `sparse`, which has its files itself, as written by colmap
// image_undistorter, or in folders 0, 1, ..., as written by colmap mapper: one for each part of the
// scene that could not be joined to another. Of several models the one with the most images, with a
// notice. Without a model sparse/0 if it exists, else empty.
std::string find_colmap_model(const std::string& sparse, std::vector<std::string>& notices);
// Whether find_colmap_model finds a folder.
bool has_colmap_model(const std::string& sparse);

// The folder for find_colmap_model in the folder of a scene: sparse/, or where other programs put
// it; empty if there is no model.
std::string find_sparse(const std::string& scene);

// Reads the model in a folder; distortion becomes Camera::lens. Points may be missing. Error if
// another file is missing, if one is truncated or contradicts another, or if a camera model is
// unknown.
ColmapModel read_colmap_model(const std::string& folder);

// Reads only points3D.{bin,txt,ply} of a folder, the first that exists; empty if there is none.
PointCloud read_colmap_points(const std::string& folder);

}  // namespace gflow
