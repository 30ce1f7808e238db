// SPDX-License-Identifier: Apache-2.0
// Small files for tests of readers.
#pragma once
#include <fmt/format.h>

#include <string>
#include <vector>

#include "optim/images/image.hpp"
#include "optim/images/movie.hpp"
#include "tests/support/temporary_folder.hpp"

// An image whose pixels depend on position and seed.
inline gflow::Image pattern(int width, int height, int channels = 3, int seed = 0) {
  gflow::Image image{width, height, channels, {}};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < channels; ++c)
        image.pixels.push_back(uint8_t(x * 7 + y * 13 + c * 50 + seed * 31));
  return image;
}

inline void make_png(const TemporaryFolder& folder, const std::string& name, int width = 8,
                     int height = 6, int channels = 3, int seed = 0) {
  gflow::write_png(folder.file(name), pattern(width, height, channels, seed));
}

inline void make_mp4(const std::string& path, const std::vector<gflow::Image>& frames, double fps) {
  gflow::write_movie(
      path, frames.size(), [&](size_t i) { return frames[i]; }, fps);
}

// The folder of the shared scenes and data, which may be missing.
inline std::string shared(const std::string& name) {
  return std::string(GFLOW_SOURCE_DIR) + "/../shared/" + name;
}
