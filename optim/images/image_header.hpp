// SPDX-License-Identifier: Apache-2.0
// The header of a PNG or JPEG, read without decoding. Used to check scenes of thousands of images.
#pragma once
#include <string>

#include "runtime/files/atomic_file.hpp"

namespace gflow {

// Largest side of any image or view [px]; larger ones are an Error everywhere.
constexpr int largest_side = 16384;

struct ImageHeader {
  int width = 0, height = 0;  // [px], 1 to largest_side
  bool has_alpha = false;     // PNG with an alpha channel or transparent palette entries or colour
};

// Error if the file is missing, is neither PNG nor JPEG, or states a size outside of 1..16384.
ImageHeader read_image_header(const std::string& path);

// The same from the bytes of the whole file. Error also if the file is truncated (decoders often
// ignore that), a PNG checksum is wrong, or the decoded size is implausible.
ImageHeader check_image_bytes(const Bytes& bytes, const std::string& path);

}  // namespace gflow
