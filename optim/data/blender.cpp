// SPDX-License-Identifier: Apache-2.0
// D-NeRF / Blender scenes: one transforms file a split.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "optim/data/reader_util.hpp"
#include "optim/data/readers.hpp"
#include "optim/data/tracks.hpp"
#include "optim/data/transforms_file.hpp"
#include "runtime/error.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

std::vector<Frame> read_split(const std::string& folder, const std::string& split,
                              const SceneOptions& options, Scene& scene) {
  const std::string path = (fs::path(folder) / ("transforms_" + split + ".json")).string();
  if (!fs::exists(path)) return {};
  return read_frames(folder, read_transforms(path), options, scene);
}

// True flow leads from a frame's time one training interval ahead.
void add_truth(const std::string& folder, const std::string& split, double interval,
               std::vector<Frame>& frames) {
  for (Frame& frame : frames) {
    const std::string base = (fs::path(folder) / ("flow_" + split) / stem(frame.path)).string();
    find_true_flow(frame, base, std::min(1., frame.time + interval));
    frame.depth_path = first_existing(folder, {"depth_" + split + "/" + stem(frame.path) + ".npy"});
  }
}

}  // namespace

bool is_blender(const std::string& folder) {
  return fs::exists(fs::path(folder) / "transforms_train.json");
}

Scene read_blender(const std::string& folder, const SceneOptions& options) {
  Scene scene;
  scene.layout = "blender";
  scene.fps = 24;
  scene.train = read_split(folder, "train", options, scene);
  scene.test = read_split(folder, "test", options, scene);
  scene.val = read_split(folder, "val", options, scene);
  if (scene.train.empty())
    throw Error(fmt::format("{}/transforms_train.json has no frames", folder));

  const std::vector<double> times = distinct_times(scene.train);
  scene.steps = int(times.size());
  const double interval =
      times.size() > 1 ? (times.back() - times[0]) / double(times.size() - 1) : 1;
  for (auto* split : {&scene.train, &scene.test, &scene.val}) set_steps(times, *split);
  add_truth(folder, "train", interval, scene.train);
  add_truth(folder, "test", interval, scene.test);
  add_truth(folder, "val", interval, scene.val);
  scene.points = find_points(folder);
  for (auto* split : {&scene.train, &scene.test, &scene.val}) find_tracks(scene, *split);
  return scene;
}

}  // namespace gflow
