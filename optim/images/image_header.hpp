// SPDX-License-Identifier: Apache-2.0
// The header of an image, read without decoding. Used to check scenes of thousands of images.
#pragma once
#include <string>

#include "runtime/files/atomic_file.hpp"

namespace gflow {

// Largest side of any image or view [px]; larger ones are an Error everywhere.
constexpr int largest_side = 16384;

enum class ImageFormat { png, jpeg, webp, tiff };

struct ImageHeader {
  ImageFormat format = ImageFormat::png;  // by the content, whatever the file's name
  int width = 0, height = 0;              // [px], 1 to largest_side
  bool has_alpha = false;  // an alpha channel, or transparent palette entries or colour of a PNG
};

// Error if the file is missing, is neither PNG, JPEG, WebP nor TIFF, or states a size outside of
// 1..16384.
ImageHeader read_image_header(const std::string& path);

// The same from the bytes of the whole file. Error also if the file is truncated (decoders often
// ignore that), a PNG checksum is wrong, or the decoded size is implausible.
ImageHeader check_image_bytes(const Bytes& bytes, const std::string& path);

}  // namespace gflow
