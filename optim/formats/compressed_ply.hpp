// SPDX-License-Identifier: Apache-2.0
// PlayCanvas' compressed PLY, as SuperSplat writes it (*.compressed.ply): chunks of 256 Gaussians
// with the range of their values, and a Gaussian in four 32-bit words within these.
#pragma once
#include "optim/formats/ply.hpp"

namespace gflow {

// Whether vertices with these properties are packed in this way.
bool is_compressed(const std::vector<std::string>& vertex_properties);

// As a standard 3DGS PLY would hold it. Error when elements or properties are missing, when chunks
// or spherical harmonics do not fit the number of Gaussians, and for all that read_ply refuses.
PlyTable read_compressed_ply(const std::string& path);

}  // namespace gflow
