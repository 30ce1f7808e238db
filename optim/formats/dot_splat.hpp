// SPDX-License-Identifier: Apache-2.0
// .splat files, as read by antimatter15/splat and many web viewers: 32 bytes per Gaussian, no
// header, no view-dependent colour.
#pragma once
#include "optim/formats/ply.hpp"
#include "runtime/files/file_pieces.hpp"

namespace gflow {

// Returns a standard 3DGS PLY of SH degree 0. Error if the length is not a multiple of 32 bytes, or
// a scale is negative or not finite.
PlyTable read_dot_splat(const std::string& path);
// Reads the rest of an open file. Error also if the file shrinks meanwhile.
PlyTable read_dot_splat(FilePieces& file);

// Writes the Gaussians in descending order of volume x opacity, so that a viewer shows the most
// visible ones first. SH above degree 0 is dropped. Error if a column of a standard 3DGS PLY is
// missing.
void write_dot_splat(const std::string& path, const PlyTable& table);
// The same with computed rows, each with the columns of SplatTable(0, sh_degree).
void write_dot_splat(const std::string& path, size_t rows, int sh_degree, const PlyRow& row);

}  // namespace gflow
