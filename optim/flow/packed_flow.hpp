// SPDX-License-Identifier: Apache-2.0
// Flow as it is kept on disk: about a twelfth of its floats. Vectors are rounded to 1/64 px, which
// is far below the error of computed flow; what is left over after prediction from the neighbours
// is mostly zeros and goes through zlib. Real video of 1352x1014: 0.94 MB instead of 12.3, unpacked
// in 0.03 s; a KITTI PNG has 1.7 to 1.9 MB and takes 0.07 s, zstd makes files as small as zlib.
#pragma once
#include <string>

#include "optim/flow/optical_flow.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {

// Likely size of a packed flow [bytes a pixel]; measured were 0.2 to 0.7, at worst it is 4.3.
inline constexpr double packed_flow_bytes_per_pixel = 1;

// Rounds each component to the nearest 1/64 px: by at most 1/128 px. Where one exceeds 511 px all
// are rounded coarser, to 1/32 px up to 1023 px, and so on. Beyond 32767 px a flow is unknown.
// Confidence is kept as whether it is above 127.
Bytes packed(const TeacherFlow& teacher);

// The rounded flow. Error, which begins with `name`, when the bytes are not all that packed() made.
TeacherFlow unpacked(const Bytes& bytes, const std::string& name);

// Whether the file holds a packed flow of that size, by its first bytes and its length; what lies
// between is looked at by unpacked().
bool holds_packed_flow(const std::string& path, int width, int height);

}  // namespace gflow
