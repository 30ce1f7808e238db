// SPDX-License-Identifier: Apache-2.0
// Points of a COLMAP model for a scene whose cameras come from another file, which may use another
// coordinate system.
#pragma once
#include <string>
#include <utility>
#include <vector>

#include "optim/scene/readers/colmap_model.hpp"

namespace gflow {

// The cameras of the images that both lists name, in the same order. Names are paths without their
// extension: a file name that is unique in both lists, else one path must be the end of the other.
std::pair<std::vector<Camera>, std::vector<Camera>> common_cameras(
    const std::vector<ColmapImage>& a, const std::vector<ColmapImage>& b);

// The points of the model in `model_folder`, moved to the world of `images` by the cameras that
// both have (align_points). No points, with a notice, if these are fewer than three or do not
// agree. `source` is the file with the cameras of `images`.
PointCloud points_in_world_of(const std::vector<ColmapImage>& images, const std::string& source,
                              const std::string& model_folder, std::vector<std::string>& notices);

}  // namespace gflow
