// SPDX-License-Identifier: Apache-2.0
// Masks of pixels and what is done with them.
#pragma once
#include <cstdint>
#include <vector>

namespace gflow {

// [height, width]; 1: belongs to it, 0: does not.
struct Mask {
  int width = 0, height = 0;
  std::vector<uint8_t> pixels;

  Mask() = default;
  Mask(int width, int height)
      : width(width), height(height), pixels(size_t(width) * size_t(height)) {}
  uint8_t& at(int x, int y) { return pixels[size_t(y) * size_t(width) + size_t(x)]; }
  uint8_t at(int x, int y) const { return pixels[size_t(y) * size_t(width) + size_t(x)]; }
};

// Pixels with more than the share `least` of the mask within `radius` pixels, in a square.
Mask with_share_around(const Mask& mask, int radius, double least);
// Whatever is within `radius` pixels of the mask.
inline Mask dilated(const Mask& mask, int radius) { return with_share_around(mask, radius, 0); }

// Connected parts (of four neighbours): labels [height, width] from 1 on, 0 outside of the mask.
struct Parts {
  int count = 0;
  std::vector<int> labels;
  std::vector<size_t> sizes;  // [count] in pixels
};
Parts parts_of(const Mask& mask);

}  // namespace gflow
