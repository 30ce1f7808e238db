// SPDX-License-Identifier: Apache-2.0
// .splat files, as antimatter15/splat and many web viewers read them: 32 bytes a Gaussian and
// nothing else; colour is the same from all sides.
#pragma once
#include "optim/formats/ply.hpp"
#include "runtime/files/file_pieces.hpp"

namespace gflow {

// As a standard 3DGS PLY of degree 0. Error when the file is no multiple of 32 bytes long, or a
// scale is negative or not finite.
PlyTable read_dot_splat(const std::string& path);
// The rest of an open file; Error also when it becomes shorter meanwhile.
PlyTable read_dot_splat(FilePieces& file);

// Largest first (volume x opacity), so that a viewer that still loads shows what matters. Error
// when a column of a standard 3DGS PLY is missing; spherical harmonics above degree 0 are left out.
void write_dot_splat(const std::string& path, const PlyTable& table);
// The same of rows, [SplatTable(0, sh_degree)'s columns], that are made while they are written.
void write_dot_splat(const std::string& path, size_t rows, int sh_degree, const PlyRow& row);

}  // namespace gflow
