// SPDX-License-Identifier: Apache-2.0
// Cropping of cameras and images to the part that a view renders.
#pragma once
#include <algorithm>
#include <vector>

#include "optim/images/rect.hpp"
#include "shared/types.h"

namespace gflow {

// The camera of a part of its image.
inline PinholeCamera crop(PinholeCamera camera, const Rect& part) {
  camera.full_width = camera.width;
  camera.full_height = camera.height;
  camera.left = float(part.x);
  camera.top = float(part.y);
  camera.width = part.width;
  camera.height = part.height;
  return camera;
}

// A part of interleaved rows [H, W, channels].
template <class T>
void crop(const std::vector<T>& whole, int width, int channels, const Rect& part,
          std::vector<T>& out) {
  out.resize(size_t(part.width) * size_t(part.height) * size_t(channels));
  const size_t row = size_t(part.width) * size_t(channels);
  for (int y = 0; y < part.height; ++y) {
    const auto from = whole.begin() + (long(part.y + y) * width + part.x) * channels;
    std::copy(from, from + long(row), out.begin() + long(row) * y);
  }
}

// A part of [H, W, 2] as planes [2, h, w].
inline void crop_planes(const std::vector<float>& uv, int width, const Rect& part,
                        std::vector<float>& planes) {
  const size_t pixels = size_t(part.width) * size_t(part.height);
  planes.resize(2 * pixels);
  size_t i = 0;
  for (int y = part.y; y < part.y + part.height; ++y)
    for (int x = part.x; x < part.x + part.width; ++x, ++i) {
      const size_t at = 2 * (size_t(y) * size_t(width) + size_t(x));
      planes[i] = uv[at];
      planes[pixels + i] = uv[at + 1];
    }
}

}  // namespace gflow
