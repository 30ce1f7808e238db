// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/masks.hpp"

#include <algorithm>
#include <array>

namespace gflow {

Mask with_share_around(const Mask& mask, int radius, double least) {
  const int w = mask.width, h = mask.height;
  std::vector<uint32_t> sums(size_t(w + 1) * size_t(h + 1));  // of all pixels above and to the left
  const auto sum = [&](int x, int y) -> uint32_t& {
    return sums[size_t(y) * size_t(w + 1) + size_t(x)];
  };
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x)
      sum(x + 1, y + 1) = mask.at(x, y) + sum(x, y + 1) + sum(x + 1, y) - sum(x, y);
  Mask result(w, h);
  for (int y = 0; y < h; ++y)
    for (int x = 0; x < w; ++x) {
      const int left = std::max(x - radius, 0), right = std::min(x + radius + 1, w);
      const int top = std::max(y - radius, 0), bottom = std::min(y + radius + 1, h);
      const uint32_t inside =
          sum(right, bottom) - sum(left, bottom) - sum(right, top) + sum(left, top);
      result.at(x, y) = inside > least * (right - left) * (bottom - top);
    }
  return result;
}

Parts parts_of(const Mask& mask) {
  Parts parts;
  parts.labels.resize(mask.pixels.size());
  std::vector<std::array<int, 2>> open;
  for (int y = 0; y < mask.height; ++y)
    for (int x = 0; x < mask.width; ++x) {
      const auto take = [&](int i, int j) {
        if (i < 0 || j < 0 || i >= mask.width || j >= mask.height || !mask.at(i, j)) return;
        int& label = parts.labels[size_t(j) * size_t(mask.width) + size_t(i)];
        if (label > 0) return;
        label = parts.count;
        open.push_back({i, j});
      };
      if (!mask.at(x, y) || parts.labels[size_t(y) * size_t(mask.width) + size_t(x)] > 0) continue;
      ++parts.count;
      parts.sizes.push_back(0);
      take(x, y);
      while (!open.empty()) {
        const auto [i, j] = open.back();
        open.pop_back();
        ++parts.sizes.back();
        take(i - 1, j), take(i + 1, j), take(i, j - 1), take(i, j + 1);
      }
    }
  return parts;
}

}  // namespace gflow
