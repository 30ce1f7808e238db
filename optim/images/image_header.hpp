// SPDX-License-Identifier: Apache-2.0
// What the first bytes of a PNG or JPEG say, without decoding: a scene of thousands of pictures is
// checked in this way.
#pragma once
#include <string>

#include "runtime/files/atomic_file.hpp"

namespace gflow {

// A picture or a view with more pixels on a side is refused everywhere [px].
constexpr int largest_side = 16384;

struct ImageHeader {
  int width = 0, height = 0;  // [px], 1 to largest_side
  bool has_alpha = false;     // PNG with alpha channel, transparent palette entries or colour
};

// Error when the file is missing, is neither PNG nor JPEG, or states a size outside of 1..16384.
ImageHeader read_image_header(const std::string& path);

// The same from the bytes of the whole file; Error also when the file ends too early, which
// decoders tend to pass over in silence.
ImageHeader check_image_bytes(const Bytes& bytes, const std::string& path);

}  // namespace gflow
