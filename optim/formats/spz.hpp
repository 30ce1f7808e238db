// SPDX-License-Identifier: Apache-2.0
// .spz files (nianticlabs/spz), versions 2 and 3, gzipped or not, and 4.
#pragma once
#include "optim/formats/ply.hpp"

namespace gflow {

// Returns a standard 3DGS PLY, rotated from the axes of the format (y up, z backward) to those of a
// PLY (y down, z forward), with antialiased_comment if the header says so. Error if the version is
// unknown or the file is shorter than its header says.
PlyTable read_spz(const std::string& path);

}  // namespace gflow
