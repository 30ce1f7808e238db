// SPDX-License-Identifier: Apache-2.0
#include "optim/train/loaded_scene.hpp"

#include <fmt/format.h>

#include "optim/train/warning.hpp"

namespace gflow {

SceneOptions options_of(const SceneConfig& config) {
  SceneOptions options;
  options.images = config.images;
  options.holdout = config.holdout;
  options.test_every = config.test_every;
  options.cameras = config.cameras;
  options.camera = config.camera;
  options.fps = config.fps;
  options.elevation = config.elevation;
  options.radius = config.radius;
  options.fov_y = config.fovy;
  options.masks = config.masks;
  options.first_views = config.first_views;
  options.first_step = config.first_step;
  options.stride = config.stride;
  options.max_steps = config.max_steps;
  return options;
}

LoadedScene load_scene(const SceneConfig& config, const std::string& unpack_folder,
                       std::optional<std::array<double, 3>> origin) {
  SceneOptions options = options_of(config);
  options.origin = origin;
  LoadedScene loaded{read_scene(config.path, options), nullptr};
  for (const std::string& notice : loaded.scene.notices) warn(notice);
  FrameStoreOptions store;
  store.resolution = config.resolution;
  store.background.fill(shown_level(config.background));
  store.unpack_folder = unpack_folder;
  loaded.frames = std::make_unique<FrameStore>(loaded.scene, store);
  return loaded;
}

const std::vector<Frame>& frames_of_split(const Scene& scene, const std::string& split) {
  const std::vector<Frame>* frames = nullptr;
  if (split == "train") frames = &scene.train;
  if (split == "test") frames = &scene.test;
  if (split == "val") frames = &scene.val;
  if (!frames) throw Error("there is no split '" + split + "': choose train, test or val");
  if (frames->empty()) throw Error(fmt::format("scene {} has no {} views", scene.name, split));
  return *frames;
}

}  // namespace gflow
