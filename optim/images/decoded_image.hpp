// SPDX-License-Identifier: Apache-2.0
// PNGs and JPEGs by libpng and libjpeg, pixel by pixel as OpenCV reads them with the same
// libraries: but there these write on stderr what they think of a file, without its name, most of
// it of what no pixel needs; and pixels that a JPEG lacks are invented.
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "runtime/files/atomic_file.hpp"

namespace gflow {

struct DecodedPicture {
  int width = 0, height = 0;    // [px]
  int channels = 0, bits = 0;   // 1, 3 or 4; 8 or 16, then in the machine's order of bytes
  std::vector<uint8_t> pixels;  // [height, width, channels], red first; empty: it is damaged
  std::string complaint;        // the first thing that the library says of the pixels; "": nothing

  size_t row() const { return size_t(width) * size_t(channels) * size_t(bits / 8); }  // [bytes]
};

// Of a file whose parts are whole (check_image_bytes). Grey with alpha has 4 channels, 4 inks
// have 3.
DecodedPicture decode_png(const Bytes& bytes);
DecodedPicture decode_jpeg(const Bytes& bytes);

}  // namespace gflow
