// SPDX-License-Identifier: Apache-2.0
// What other programs write differently into a PLY of trained Gaussians, and how it becomes the
// standard form (splat_table.hpp).
#pragma once
#include <string>
#include <vector>

#include "optim/formats/ply.hpp"

namespace gflow {

// Comment of a PLY whose Gaussians were trained with antialiasing, as Brush and gsplat write it.
constexpr const char* antialiased_comment = "SplatRenderMode: mip";

// Whether the last comment on it, in this form or in Postshot's "antialiased 1", says so.
bool is_antialiased(const std::vector<std::string>& comments);

// Property names of a PLY after with_standard_columns(). Error that names `path` if the file is a
// point cloud, or if a network makes the colours of its Gaussians (SpacetimeGaussians, full model).
std::vector<std::string> standard_names(std::vector<std::string> names, const std::string& path);

// Warns of what gflow cannot know for sure: scales and opacities that look as if their logarithm
// and logit were forgotten, and a deformation network beside the file (4DGaussians,
// Deformable-3D-Gaussians). Call it before with_standard_columns().
void warn_of_doubts(const PlyTable& table, const std::string& path);

// Converts the columns of a PLY of another program, `table` read from `path`, with a warning if the
// file differs from what it seems to be:
//   no scale_2       flat Gaussians (2D Gaussian Splatting)
//   red green blue   colours instead of f_dc_* (nerfstudio)
//   filter_3D        a filter still to be applied to scales and opacities (mip-splatting)
//   trbf_center ...  moving Gaussians of SpacetimeGaussians, lite model; become those of the motion
//                    model spacetime without their cubic term
PlyTable with_standard_columns(PlyTable table, const std::string& path);

}  // namespace gflow
