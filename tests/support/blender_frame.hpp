// SPDX-License-Identifier: Apache-2.0
// A frame of a Blender scene as text.
#pragma once
#include <fmt/format.h>

#include <string>

#include "optim/scene/camera.hpp"

namespace gflow {

// An entry of "frames" in transforms_*.json; axes are OpenGL's. path: of the image, without
// extension.
inline std::string blender_frame(const Camera& camera, const std::string& path, double time) {
  const Eigen::Matrix3d r = camera.viewmat.topLeftCorner<3, 3>().transpose();
  const Eigen::Vector3d p = camera.position();
  std::string rows;
  for (int i = 0; i < 3; ++i)
    rows += fmt::format("[{},{},{},{}],", r(i, 0), -r(i, 1), -r(i, 2), p[i]);
  return fmt::format(R"({{"file_path": "{}", "time": {}, "transform_matrix": [{}[0,0,0,1]]}})",
                     path, time, rows);
}

}  // namespace gflow
