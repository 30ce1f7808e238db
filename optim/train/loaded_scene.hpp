// SPDX-License-Identifier: Apache-2.0
// A scene as the settings ask for it.
#pragma once
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "optim/data/frame_store.hpp"
#include "optim/train/config.hpp"

namespace gflow {

// What the settings say to read_scene.
SceneOptions options_of(const SceneConfig& config);

// A scene read as the configuration says, and its pictures.
struct LoadedScene {
  Scene scene;
  std::unique_ptr<FrameStore> frames;
};
// unpack_folder: where frames of videos are kept as pictures; made when needed. origin: what the
// model's coordinates are relative to that the scene is looked at with; without one the scene
// chooses.
LoadedScene load_scene(const SceneConfig& config, const std::string& unpack_folder,
                       std::optional<std::array<double, 3>> origin = std::nullopt);

// The frames of a split; Error when it has none.
const std::vector<Frame>& frames_of_split(const Scene& scene, std::string_view split);

// Everything that cached flow and video frames depend on: pictures and masks by path, size and time
// of change, which picture follows which, what is undone of the lens, and how flow is computed.
std::string cache_stamp(const Scene& scene, const SceneConfig& config);

}  // namespace gflow
