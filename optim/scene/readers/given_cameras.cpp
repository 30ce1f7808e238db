// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/readers/given_cameras.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "optim/scene/cameras_json.hpp"
#include "optim/scene/json_file.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "optim/scene/readers/static_camera.hpp"
#include "optim/scene/readers/transforms_file.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace {

std::vector<Camera> read_cameras(const std::string& path, int width, int height,
                                 const std::string& source) {
  if (read_json(path).is_object())
    return read_cameras(read_transforms(path), width, height, source);
  std::vector<Camera> cameras = read_cameras_json(path, 1);
  for (Camera& camera : cameras) camera = fitted_to(camera, width, height, path, source);
  return cameras;
}

}  // namespace

std::vector<Camera> cameras_of_view(const SceneOptions& options, size_t count, int width,
                                    int height, const std::string& source) {
  if (options.cameras.empty()) return {static_camera("input", 0, options, width, height)};
  std::vector<Camera> cameras = read_cameras(options.cameras, width, height, source);
  if (!options.camera.empty()) {
    const auto named = std::find_if(cameras.begin(), cameras.end(), [&](const Camera& camera) {
      return camera.name == options.camera || stem(camera.name) == options.camera;
    });
    return {named != cameras.end() ? *named : camera_named(cameras, options.camera)};
  }
  if (cameras.size() == 1) return cameras;
  // max_steps limits how many frames of a video are decoded.
  const bool enough = options.max_steps > 0 && cameras.size() > count;
  if (cameras.size() != count && !enough)
    throw Error(
        fmt::format("{} has {} cameras, but the view of {} has {} images: expected one camera, one "
                    "per image, or the name of one in scene.camera",
                    options.cameras, cameras.size(), source, count));
  std::stable_sort(cameras.begin(), cameras.end(),
                   [](const Camera& a, const Camera& b) { return natural_less(a.name, b.name); });
  cameras.resize(count);
  return cameras;
}

}  // namespace gflow
