// SPDX-License-Identifier: Apache-2.0
// PlayCanvas' compressed PLY, as written by SuperSplat (*.compressed.ply): chunks of 256 Gaussians
// with the range of their values, and four 32-bit words per Gaussian within these ranges.
#pragma once
#include "optim/formats/ply.hpp"

namespace gflow {

// Whether vertices with these properties are packed in this way.
bool is_compressed(const std::vector<std::string>& vertex_properties);

// Returns a standard 3DGS PLY, with antialiased_comment if is_antialiased. Error if elements or
// properties are missing, if chunks or SH do not match the number of Gaussians, or if the PLY
// itself cannot be read (read_ply_elements).
PlyTable read_compressed_ply(const std::string& path);

}  // namespace gflow
