// SPDX-License-Identifier: Apache-2.0
// D-NeRF / Blender scenes: one transforms file per split.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>

#include "optim/scene/depth_map.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "optim/scene/readers/readers.hpp"
#include "optim/scene/readers/transforms_file.hpp"
#include "optim/scene/tracks.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

std::string path_of(const std::string& folder, const std::string& split) {
  return (fs::path(folder) / ("transforms_" + split + ".json")).string();
}

// timed: whether training frames have a 'time'; set by the first file read. Test views of a moving
// scene without times would all be placed at its beginning.
std::vector<Frame> read_split(const std::string& folder, const std::string& split,
                              const SceneOptions& options, std::optional<bool>& timed,
                              Scene& scene) {
  const std::string path = path_of(folder, split);
  if (!fs::exists(path)) return {};
  const Transforms file = read_transforms(path);
  if (!timed) timed = has_times(file);
  if (!file.json["frames"].empty() && has_times(file) != *timed)
    throw Error(
        fmt::format("frame 0 of {} has {} 'time', but the frames of {} have {}: either all frames "
                    "must have 'time' or none",
                    path, *timed ? "no" : "a", path_of(folder, "train"), *timed ? "one" : "none"));
  return read_frames(folder, file, options, scene);
}

// Adds true flow, which leads one training interval ahead, and true depth.
void add_truth(const std::string& folder, const std::string& split, double interval,
               std::vector<Frame>& frames) {
  for (Frame& frame : frames) {
    const std::string base = (fs::path(folder) / ("flow_" + split) / stem(frame.path)).string();
    find_true_flow(frame, base, std::min(1., frame.time + interval));
    frame.depth_path = find_depth(join(folder, "depth_" + split + "/" + stem(frame.path)));
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
  std::optional<bool> timed;
  scene.train = read_split(folder, "train", options, timed, scene);
  if (scene.train.empty())
    throw Error(fmt::format("{}/transforms_train.json has no frames", folder));
  scene.test = read_split(folder, "test", options, timed, scene);
  scene.val = read_split(folder, "val", options, timed, scene);

  const std::string files = join(folder, "transforms_*.json");
  normalise_times({&scene.train, &scene.test, &scene.val}, files, scene.notices);
  const std::vector<double> times = distinct_times(scene.train);
  scene.steps = int(times.size());
  const double interval =
      times.size() > 1 ? (times.back() - times[0]) / double(times.size() - 1) : 1;
  for (auto* split : {&scene.train, &scene.test, &scene.val}) set_steps(times, *split);
  add_truth(folder, "train", interval, scene.train);
  add_truth(folder, "test", interval, scene.test);
  add_truth(folder, "val", interval, scene.val);
  scene.points = points_beside(folder, files, scene);
  if (scene.points.size() == 0) report_other_points(folder, scene.notices);
  if (fs::exists(join(folder, "transforms.json")))
    scene.notices.push_back(
        fmt::format("transforms.json of {} is not read, because transforms_train.json is there: "
                    "move that away to read transforms.json instead",
                    folder));
  for (auto* split : {&scene.train, &scene.test, &scene.val}) find_tracks(scene, *split);
  return scene;
}

}  // namespace gflow
