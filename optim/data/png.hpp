// SPDX-License-Identifier: Apache-2.0
// PNGs by libpng, as OpenCV reads them: but there libpng writes on stderr what it thinks of a file,
// without the file's name, and most of it is of colour profiles and texts, which no pixel needs.
#pragma once
#include <opencv2/core.hpp>
#include <string>

#include "optim/io/atomic_file.hpp"

namespace gflow {

struct DecodedPng {
  cv::Mat pixels;  // 8 or 16 bits, 1, 3 or 4 channels, blue first; empty: it cannot be decoded
  std::string complaint;  // the first thing that libpng says of what makes the pixels; "": nothing
};

// Of a PNG whose chunks are whole (check_image_bytes). Grey with alpha has 4 channels.
DecodedPng decode_png(const Bytes& bytes);

}  // namespace gflow
