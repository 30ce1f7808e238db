// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/true_depth.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "optim/formats/npy.hpp"
#include "runtime/base/error.hpp"

namespace gflow {

std::vector<float> read_true_depth(const Frame& frame, int width, int height) {
  if (frame.depth_path.empty()) throw Error(fmt::format("frame {} has no true depth", frame.name));
  const Array array = read_npy(frame.depth_path);
  if (array.shape.size() != 2 || array.size() == 0)
    throw Error(fmt::format("depth {} has shape {}, expected (height, width)", frame.depth_path,
                            array.shape_text()));
  const size_t rows = array.shape[0], columns = array.shape[1];
  const double sx = double(width) / double(columns), sy = double(height) / double(rows);
  if (!(sx / sy > 0.98 && sx / sy < 1.02))
    throw Error(fmt::format("depth {} is {}x{}, but its image is {}x{}: the aspect ratios differ",
                            frame.depth_path, columns, rows, width, height));
  std::vector<float> from = array.as_float();
  if (columns == size_t(width) && rows == size_t(height)) return from;
  std::vector<float> depth(size_t(width) * size_t(height));
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const size_t row = std::min(size_t((y + 0.5) / sy), rows - 1);
      const size_t column = std::min(size_t((x + 0.5) / sx), columns - 1);
      depth[size_t(y) * size_t(width) + size_t(x)] = from[row * columns + column];
    }
  return depth;
}

}  // namespace gflow
