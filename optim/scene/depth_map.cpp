// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/depth_map.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "optim/formats/npy.hpp"
#include "optim/images/image.hpp"
#include "optim/scene/lens.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

struct Grid {
  size_t width = 0, height = 0;
  std::vector<float> values;  // [height, width]
};

// Integers in scene units.
std::vector<float> with_unit(std::vector<float> values, const SceneOptions& options) {
  if (options.depth == DepthFiles::metric)
    for (float& value : values) value *= options.depth_unit;
  return values;
}

// [H, W], also with sides of 1: networks write [1, H, W] and [H, W, 1].
Grid read_array(const std::string& path, const SceneOptions& options) {
  const Array array = read_npy(path);
  std::vector<size_t> shape = array.shape;
  if (shape.size() > 2) shape.erase(std::remove(shape.begin(), shape.end(), 1u), shape.end());
  if (shape.size() != 2 || array.size() == 0)
    throw Error(
        fmt::format("depth {} has shape {}, expected (height, width)", path, array.shape_text()));
  const bool reals = std::holds_alternative<std::vector<float>>(array.values) ||
                     std::holds_alternative<std::vector<double>>(array.values);
  return {shape[1], shape[0], reals ? array.as_float() : with_unit(array.as_float(), options)};
}

Grid read_levels(const std::string& path, const SceneOptions& options) {
  const GreyLevels grey = read_grey_levels(path);
  return {size_t(grey.width), size_t(grey.height),
          with_unit({grey.levels.begin(), grey.levels.end()}, options)};
}

}  // namespace

std::string find_depth(const std::string& base) {
  for (const char* extension : {".npy", ".png"})
    if (const std::string path = base + extension; fs::is_regular_file(path)) return path;
  return "";
}

void find_depth_files(Scene& scene) {
  const fs::path folder = fs::path(scene.folder) / "depth";
  if (!fs::is_directory(folder)) return;
  for (std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val})
    for (Frame& frame : *split) {
      if (!frame.depth_path.empty() || frame.video_frame >= 0) continue;
      const fs::path image = fs::path(frame.path).lexically_relative(scene.folder);
      for (auto part = image.begin(); part != image.end() && frame.depth_path.empty(); ++part) {
        fs::path name;
        for (auto rest = part; rest != image.end(); ++rest) name /= *rest;
        frame.depth_path = find_depth((folder / name.replace_extension()).string());
      }
    }
}

std::vector<float> read_depth_map(const Frame& frame, const Camera& camera, int width, int height,
                                  const SceneOptions& options) {
  const std::string& path = frame.depth_path;
  if (path.empty()) throw Error(fmt::format("frame {} has no depth file", frame.name));
  const Grid grid =
      fs::path(path).extension() == ".png" ? read_levels(path, options) : read_array(path, options);
  const double columns = double(grid.width), rows = double(grid.height);
  const double shape = columns / rows / (double(camera.width) / double(camera.height));
  if (!(shape > 0.98 && shape < 1.02))
    throw Error(fmt::format("depth {} is {}x{}, but its image is {}x{}: the aspect ratios differ",
                            path, grid.width, grid.height, camera.width, camera.height));
  std::vector<float> depth;
  depth.reserve(size_t(width) * size_t(height));
  const auto nearest = [](double at, size_t size) {
    return size_t(std::clamp(at, 0., double(size) - 1));
  };
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const Eigen::Vector2d at =
          stored_at(camera, (x + 0.5) * camera.width / width, (y + 0.5) * camera.height / height);
      depth.push_back(grid.values[nearest(at.y() * rows / camera.height, grid.height) * grid.width +
                                  nearest(at.x() * columns / camera.width, grid.width)]);
    }
  return depth;
}

}  // namespace gflow
