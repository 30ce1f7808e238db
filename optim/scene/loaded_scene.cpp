// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/loaded_scene.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <filesystem>

#include "runtime/base/warning.hpp"

namespace gflow {

LoadedScene load_scene(const SceneOptions& options, const std::string& unpack_folder,
                       std::optional<std::array<double, 3>> origin) {
  Scene scene = read_scene(options.path, options, origin);
  for (const std::string& notice : scene.notices) warn(notice);
  return with_frames(std::move(scene), options, unpack_folder);
}

LoadedScene with_frames(Scene scene, const SceneOptions& options,
                        const std::string& unpack_folder) {
  LoadedScene loaded{std::move(scene), nullptr};
  FrameStoreOptions store;
  store.resolution = options.resolution;
  store.background.fill(shown_level(options.background));
  store.unpack_folder = unpack_folder;
  loaded.frames = std::make_unique<FrameStore>(loaded.scene, store);
  return loaded;
}

const std::vector<Frame>& frames_of_split(const Scene& scene, std::string_view split) {
  const std::vector<Frame>* frames = nullptr;
  if (split == "train") frames = &scene.train;
  if (split == "test") frames = &scene.test;
  if (split == "val") frames = &scene.val;
  if (!frames) throw Error(fmt::format("there is no split '{}': choose train, test or val", split));
  if (frames->empty()) throw Error(fmt::format("scene '{}' has no {} views", scene.name, split));
  return *frames;
}

std::string cache_stamp(const Scene& scene, const SceneOptions& options) {
  namespace fs = std::filesystem;
  std::string stamp = fmt::format("packed DIS flow 4, resolution {} background {}\n",
                                  options.resolution, name_of(options.background));
  const auto add_file = [&](const std::string& path) {
    stamp += fmt::format("{} {} {}\n", path, fs::file_size(path),
                         fs::last_write_time(path).time_since_epoch().count());
  };
  std::string last;
  for (const std::vector<Frame>* frames : {&scene.train, &scene.test})
    for (const Frame& frame : *frames) {
      stamp += frame.name + "\n";
      if (!frame.mask_path.empty()) add_file(frame.mask_path);
      if (frame.path == last) continue;  // the next frame of the same video
      add_file(frame.path);
      last = frame.path;
    }
  for (const Camera& camera : scene.cameras)
    if (camera.lens.kind != Lens::Kind::none)
      stamp += fmt::format("lens {} {} of {} {} {} {} as {} {}\n", int(camera.lens.kind),
                           fmt::join(camera.lens.k, " "), camera.lens.fx, camera.lens.fy,
                           camera.lens.cx, camera.lens.cy, camera.fx, camera.fy);
  return stamp;
}

}  // namespace gflow
