// SPDX-License-Identifier: Apache-2.0
// Pictures: 8-bit interleaved, red first, rows from the top. Values are sRGB as stored; nothing
// here converts to linear light.
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "optim/formats/flo.hpp"

namespace gflow {

struct Image {
  int width = 0, height = 0;    // [px]
  int channels = 0;             // 1 grey, 3 RGB, 4 RGBA with straight alpha
  std::vector<uint8_t> pixels;  // [height, width, channels]
};

// A PNG or JPEG as RGB or RGBA (when it has alpha); grey and palette pictures become RGB, 16 bits
// are rounded to 8. Error when missing, damaged, truncated or larger than 16384 x 16384. A camera's
// turn noted in EXIF is not applied, because poses refer to the stored picture.
Image read_image(const std::string& path);

// A grey picture (masks); colours are averaged as OpenCV does.
Image read_grey(const std::string& path);

// RGB of an RGBA picture before a background, in stored values: rgb a + background (1 - a).
// RGB pictures are returned as they are.
Image over_background(Image image, std::array<uint8_t, 3> background);

// A picture of the given size; each pixel is the mean over the area it covers when shrinking.
// Colours are weighted by alpha, so that hidden colours of transparent pixels do not bleed in.
Image resized(const Image& image, int width, int height);

// A picture of the given size whose pixel i is that of `image` at the place (x, y) = from[2 i],
// from[2 i + 1] (pixel centres at .5), between pixels linearly, outside as at the nearest border.
// Colours are weighted by alpha.
Image remapped(const Image& image, int width, int height, const std::vector<float>& from);

// 8-bit PNG, grey, RGB or RGBA by channels. The file appears complete or not at all.
void write_png(const std::string& path, const Image& image);

// 16-bit grey PNG, [height, width]; e.g. depth.
void write_png16(const std::string& path, int width, int height,
                 const std::vector<uint16_t>& values);

// KITTI flow: 16-bit RGB PNG, u = (R - 2^15) / 64, v = (G - 2^15) / 64, valid where B > 0.
FlowField read_kitti_flow(const std::string& path);

}  // namespace gflow
