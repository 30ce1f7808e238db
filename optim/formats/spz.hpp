// SPDX-License-Identifier: Apache-2.0
// .spz files (nianticlabs/spz), versions 2 and 3, gzipped or not.
#pragma once
#include "optim/formats/ply.hpp"

namespace gflow {

// As a standard 3DGS PLY, turned from the format's axes (y up, z backward) to those of a PLY (y
// down, z forward). Error when the file is of another version, or shorter than its header says.
PlyTable read_spz(const std::string& path);

}  // namespace gflow
