// SPDX-License-Identifier: Apache-2.0
// A scene whose images are in memory, changed by a test.
#pragma once
#include "optim/images/image.hpp"
#include "optim/scene/loaded_scene.hpp"

namespace gflow {

// A copy of the scene without flow. change(frame, image, is_training) may change each image and set
// its mask, which means `masks`.
template <class Change>
Scene in_memory(const LoadedScene& loaded, Change&& change, Masks masks = Masks::alpha) {
  Scene scene;
  scene.name = "in memory";
  scene.cameras = loaded.scene.cameras;
  scene.points = loaded.scene.points;
  scene.masks = masks;
  const auto add = [&](const std::vector<Frame>& from, std::vector<Frame>& to) {
    for (const Frame& file : from) {
      Frame frame;
      frame.camera = file.camera;
      frame.track = file.track;
      frame.time = file.time;
      frame.name = file.name;
      Image image = *loaded.frames->rgb(file);
      change(frame, image, &to == &scene.train);
      frame.image = std::make_shared<const Image>(std::move(image));
      to.push_back(frame);
    }
  };
  add(loaded.scene.train, scene.train);
  add(loaded.scene.test, scene.test);
  complete_scene(scene);
  return scene;
}

}  // namespace gflow
