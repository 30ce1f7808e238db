// SPDX-License-Identifier: Apache-2.0
// The poses file of LLFF: one row per camera. Each row is a 3x5 matrix [R | t | h w f] and two
// depths; the columns of R are the camera's down, right and backward axes.
#pragma once
#include <string>
#include <vector>

namespace gflow {

struct LlffPoses {
  std::string path;
  size_t rows = 0;             // number of cameras
  std::vector<double> values;  // [rows, 17]

  // Whether 4DGaussians' script for several cameras wrote the file.
  bool is_multipleview() const;
  const double* row(size_t i) const { return &values[17 * i]; }
};

// Path of poses_bounds.npy in a folder, else of poses_bounds_multipleview.npy, or empty.
std::string find_llff_poses(const std::string& folder);

// Error if the file does not have 17 columns.
LlffPoses read_llff_poses(const std::string& path);

// A camera that has a row.
struct LlffCamera {
  std::string name;  // cam01
  std::string file;  // its folder, image or video, by which LLFF sorts: cam01.mp4
};

// The indices of the cameras in the order of the rows: LLFF (imgs2poses.py) sorts names as text, so
// that cam10 is before cam2. 4DGaussians' script gives it copies of the images of cam01, cam02, ...
// as image1.jpg, image2.jpg, ..., so that cam10 is before cam02. A notice if the order of the
// numbers differs.
std::vector<size_t> order_of_rows(const LlffPoses& poses, const std::vector<LlffCamera>& cameras,
                                  std::vector<std::string>& notices);

}  // namespace gflow
