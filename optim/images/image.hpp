// SPDX-License-Identifier: Apache-2.0
// 8-bit interleaved images, RGB order, rows from the top. Values are sRGB as stored; nothing here
// converts to linear light.
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

// Reads a PNG, JPEG, WebP or TIFF as RGB, or RGBA if it has alpha. Grey and palette images become
// RGB; 16 bits are rounded to 8, which limits PSNR to 59 dB. Ignores the
// EXIF orientation, because poses refer to the stored image. Error if the file is missing, damaged,
// truncated or larger than 16384 x 16384.
Image read_image(const std::string& path);

// Reads an image as grey, for masks; colours are converted by OpenCV's weights. Of an image
// of one colour with alpha this is the alpha channel.
Image read_grey(const std::string& path);

// Composites RGBA over a background in stored values: rgb a + background (1 - a). RGB images are
// returned unchanged.
Image over_background(Image image, std::array<uint8_t, 3> background);

// Resizes an image: area averaging if it shrinks, else bilinear. Colours are weighted by alpha, so
// that hidden colours of transparent pixels do not bleed in.
Image resized(const Image& image, int width, int height);

// Resamples an image: output pixel i is `image` at (from[2 i], from[2 i + 1]) [px], pixel centres
// at .5. Bilinear; positions outside clamp to the border. Colours are weighted by alpha.
Image remapped(const Image& image, int width, int height, const std::vector<float>& from);

// 8-bit PNG: grey, RGB or RGBA by channels. Replaces the file atomically.
void write_png(const std::string& path, const Image& image);

// An RGB image as the bytes of a JPEG; quality: 1 to 100. Error for other channels.
std::vector<uint8_t> jpeg_of(const Image& image, int quality);

// 16-bit grey PNG, [height, width], for instance of depth.
void write_png16(const std::string& path, int width, int height,
                 const std::vector<uint16_t>& values);

// A grey PNG of 8 or 16 bits as stored, [height, width], for instance depth. Error for
// other images.
struct GreyLevels {
  int width = 0, height = 0;  // [px]
  std::vector<uint16_t> levels;
};
GreyLevels read_grey_levels(const std::string& path);

// KITTI flow: 16-bit RGB PNG, u = (R - 2^15) / 64, v = (G - 2^15) / 64, valid where B > 0.
FlowField read_kitti_flow(const std::string& path);

}  // namespace gflow
