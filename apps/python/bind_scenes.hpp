// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "apps/python/cameras.hpp"
#include "optim/options/train_options.hpp"
#include "optim/scene/loaded_scene.hpp"

namespace gflow::python {

// What a gflow.Scene holds.
struct PyScene {
  LoadedScene loaded;
  SceneOptions options;
  bool in_memory = false;  // made of arrays, so that there is no folder to read it from again
};

// Applies "section.key=value". InputError without the option that the command has for it.
void apply_settings(TrainOptions& options, const std::vector<std::string>& settings);

}  // namespace gflow::python
