// SPDX-License-Identifier: Apache-2.0
// PNG, JPEG, WebP and TIFF by their own libraries. OpenCV's decoders, which use them as well, print
// warnings to stderr without the file's name and return invented pixels for a truncated JPEG.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "optim/images/byte_source.hpp"
#include "optim/images/image_header.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {

struct DecodedImage {
  int width = 0, height = 0;    // [px]
  int channels = 0, bits = 0;   // 1, 3 or 4 channels; 8 or 16 bits, 16 in host byte order
  std::vector<uint8_t> pixels;  // [height, width, channels], RGB order; empty: damaged
  std::string complaint;        // first warning or error of the library; "": none

  size_t row() const { return size_t(width) * size_t(channels) * size_t(bits / 8); }  // [bytes]
};

// Decodes bytes that passed check_image_bytes. Grey with alpha becomes 4 channels, CMYK becomes 3.
// WebP and TIFF are always RGB or RGBA of 8 bits.
DecodedImage decode_png(const Bytes& bytes);
DecodedImage decode_jpeg(const Bytes& bytes);
DecodedImage decode_webp(const Bytes& bytes);
DecodedImage decode_tiff(const Bytes& bytes);

// Size and alpha without decoding. Returns why the image cannot be read, or "".
std::string webp_header(ByteSource& source, ImageHeader& header);
std::string tiff_header(ByteSource& source, ImageHeader& header);

struct PngPixels {
  int width, height;      // [px]
  int channels, bits;     // 1, 3 or 4 channels; 8 or 16 bits, 16 in host byte order
  const uint8_t* pixels;  // [height, width, channels]
};
// Encodes an image. Error with the library's reason if it cannot.
Bytes encode_png(const PngPixels& image);
// Encodes RGB of 8 bits [height, width, 3] as a JPEG; quality: 1 to 100. Error with the library's
// reason if it cannot.
Bytes encode_jpeg(int width, int height, const uint8_t* rgb, int quality);

}  // namespace gflow
