// SPDX-License-Identifier: Apache-2.0
// Loads a scene according to the settings.
#pragma once
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "optim/scene/frame_store.hpp"

namespace gflow {

// A scene and its images.
struct LoadedScene {
  Scene scene;
  std::unique_ptr<FrameStore> frames;
};
// The same of a scene in memory (complete_scene).
LoadedScene with_frames(Scene scene, const SceneOptions& options, const std::string& unpack_folder);
// unpack_folder: where video frames are stored as images; created when needed. origin: the world
// origin of the model that will be shown with this scene; by default the scene chooses one.
LoadedScene load_scene(const SceneOptions& options, const std::string& unpack_folder,
                       std::optional<std::array<double, 3>> origin = std::nullopt);

// The frames of a split. Error if there are none.
const std::vector<Frame>& frames_of_split(const Scene& scene, std::string_view split);

// Everything that cached flow and video frames depend on: path, size and modification time of
// images and masks, the order of frames, the lens correction, and the version of the flow
// computation.
std::string cache_stamp(const Scene& scene, const SceneOptions& options);

}  // namespace gflow
