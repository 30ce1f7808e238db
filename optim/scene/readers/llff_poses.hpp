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

// For one image per camera: the images that view_imgs.txt names, which some versions of
// imgs2poses.py write because COLMAP may not have found poses for all. All images if there are as
// many as rows, or no such file. `images` are names in `image_folder`.
std::vector<std::string> images_with_poses(const LlffPoses& poses, const std::string& image_folder,
                                           const std::vector<std::string>& images,
                                           std::vector<std::string>& notices);

// A camera of which there are images or a video.
struct LlffCamera {
  std::string name;  // cam01
  std::string file;  // its folder, image or video, by which LLFF sorts: cam01.mp4
};

// For each camera: its row, -1 if it has none, and whether it is to be left out.
struct LlffRows {
  std::vector<int> rows;
  std::vector<bool> skipped;
};

// LLFF (imgs2poses.py) sorts the files as text, so that cam10 is before cam2. 4DGaussians' script
// gives it copies of the images of cam01, cam02, ... as image1.jpg, image2.jpg, ..., so that cam10
// is before cam02. A notice if the order of the numbers differs.
//
// The cameras of `skip`, a list of names separated by commas, may be the reason why there are more
// rows than cameras or fewer: those that are not in `folder` but have a row, or the opposite. Error
// if the numbers differ still.
LlffRows assign_rows(const LlffPoses& poses, const std::string& folder,
                     const std::vector<LlffCamera>& found, const std::string& skip,
                     std::vector<std::string>& notices);

}  // namespace gflow
