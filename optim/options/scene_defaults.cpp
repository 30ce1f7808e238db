// SPDX-License-Identifier: Apache-2.0
#include "optim/options/scene_defaults.hpp"

#include <algorithm>
#include <set>

#include "optim/model/model.hpp"

namespace gflow {

int default_cap(const Scene& scene, int resolution) {
  constexpr double least = 30000, most = 5e6, per_pixel = 0.4, of_objects = 0.1;
  double pixels = 0;
  for (const Frame& frame : scene.train) {
    const Camera camera = reduced(scene.cameras[size_t(frame.camera)], resolution);
    pixels = std::max(pixels, double(camera.width) * camera.height);
  }
  const double cap = per_pixel * (scene.has_alpha ? of_objects : 1) * pixels;
  return int(std::clamp(cap, least, most) / 1000) * 1000;  // it stands in config.toml
}

TrainOptions with_scene_defaults(TrainOptions options, const Scene& scene) {
  options.render.near = near_or_default(options.render.near, scene);
  if (options.density.cap == 0) {
    options.density.cap = default_cap(scene, options.scene.resolution);
    if (options.init.begins_from_file() && !options.init.file.empty())  // all of them
      options.density.cap = std::max(options.density.cap, int(read_model(options.init.file).count));
  }
  return options;
}

bool begins_with_background(const Scene& scene, const TrainOptions& options) {
  constexpr int least_steps = 8;
  if (options.init.background == 0 || scene.has_alpha || options.train.sequential) return false;
  if (scene.steps < least_steps || scene.train.size() >= 2 * size_t(scene.steps)) return false;
  if (options.init.begins_from_file()) return false;
  std::set<int> poses;
  for (const Frame& frame : scene.train) poses.insert(frame.camera);
  return poses.size() > scene.train.size() / 2;
}

}  // namespace gflow
