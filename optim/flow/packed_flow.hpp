// SPDX-License-Identifier: Apache-2.0
// Compact flow for the disk, about a twelfth of the floats. Vectors are rounded to 1/64 px, far
// below the error of computed flow. The residuals of a prediction from neighbours are mostly zero
// and are compressed by zlib: smaller and faster than KITTI PNGs; zstd is not smaller.
#pragma once
#include <string>

#include "optim/flow/optical_flow.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {

// Estimated size of a packed flow [bytes per pixel]; typically 0.2 to 0.7, at worst 4.3.
inline constexpr double packed_flow_bytes_per_pixel = 1;

// Rounds each component to the nearest 1/64 px, an error of at most 1/128 px. If any component
// exceeds 511 px, all use 1/32 px, above 1023 px 1/16 px, and so on. Vectors beyond 32767 px become
// invalid. Confidence is stored as one bit: above 127.
Bytes packed(const TargetFlow& target_flow);

// The rounded flow. Error, starting with `name`, if the bytes are not exactly a result of packed().
TargetFlow unpacked(const Bytes& bytes, const std::string& name);

// Whether a file is a packed flow of this size, by its header and length only; unpacked() checks
// the rest.
bool holds_packed_flow(const std::string& path, int width, int height);

}  // namespace gflow
