// SPDX-License-Identifier: Apache-2.0
// Recognises a scene's layout and checks what a reader delivered.
#include "optim/data/scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "optim/data/reader_util.hpp"
#include "optim/data/readers.hpp"
#include "runtime/error.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

Scene read_recognised(const std::string& folder, const SceneOptions& options) {
  // Most specific first: poses_bounds.npy may have transforms and a COLMAP model beside it.
  if (is_n3v(folder)) return read_n3v(folder, options);
  if (is_consistent4d(folder)) return read_consistent4d(folder, options);
  if (is_blender(folder)) return read_blender(folder, options);
  if (is_colmap(folder)) return read_colmap(folder, options);
  throw Error(fmt::format(
      "{} is no scene gflow knows: looked for poses_bounds.npy (N3V), input/ or numbered pictures "
      "0.png, 1.png, ... (Consistent4D), transforms_train.json (Blender, D-NeRF) and sparse/0/ "
      "(COLMAP)",
      folder));
}

void drop_late_steps(Scene& scene, int max_steps) {
  const auto late = [&](const Frame& frame) { return frame.step >= max_steps; };
  for (std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val})
    split->erase(std::remove_if(split->begin(), split->end(), late), split->end());
  scene.steps = std::min(scene.steps, max_steps);
}

// Sorts the splits, and makes names unique by appending a number where paths gave equal ones.
void order_frames(Scene& scene) {
  std::set<std::string> names;
  for (std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val}) {
    std::stable_sort(split->begin(), split->end(), [](const Frame& a, const Frame& b) {
      return std::tie(a.track, a.time) < std::tie(b.track, b.time);
    });
    for (Frame& frame : *split) {
      const std::string name = frame.name;
      for (int n = 2; !names.insert(frame.name).second; ++n)
        frame.name = fmt::format("{}_{}", name, n);
    }
  }
}

void check(const Scene& scene) {
  if (scene.train.empty())
    throw Error(fmt::format("scene {} has no training pictures", scene.folder));
  for (const Camera& camera : scene.cameras) {
    const bool ok = camera.width > 0 && camera.height > 0 && camera.fx > 0 && camera.fy > 0 &&
                    std::isfinite(camera.fx + camera.fy + camera.cx + camera.cy) &&
                    camera.viewmat.allFinite();
    if (!ok)
      throw Error(fmt::format(
          "camera {} of {} has size {}x{}, focal lengths {} and {} and centre ({}, {}): all must "
          "be finite, sizes and focal lengths positive",
          camera.name, scene.folder, camera.width, camera.height, camera.fx, camera.fy, camera.cx,
          camera.cy));
  }
}

}  // namespace

Scene read_scene(const std::string& path, const SceneOptions& options) {
  if (!fs::is_directory(path))
    throw Error(fmt::format("cannot read scene {}: there is no such folder", path));
  if (options.max_steps < 0)
    throw Error(fmt::format("the number of steps to use is {}, expected is 0 (all) or more",
                            options.max_steps));
  Scene scene = read_recognised(path, options);
  scene.folder = path;
  const fs::path absolute = fs::absolute(path).lexically_normal();
  scene.name = (absolute.has_filename() ? absolute : absolute.parent_path()).filename().string();
  scene.tracks_path = first_existing(path, {"tracks3d.npy"});
  if (options.max_steps > 0) drop_late_steps(scene, options.max_steps);
  order_frames(scene);
  check(scene);
  scene.extent = scene_extent(scene);
  return scene;
}

std::vector<FlowPair> neighbour_pairs(const Scene& scene) {
  // Frames are sorted by track, then time, and readers give equal cameras one index.
  std::vector<FlowPair> pairs;
  for (size_t i = 0; i < scene.train.size(); ++i) {
    const Frame& frame = scene.train[i];
    const Frame* next = i + 1 < scene.train.size() ? &scene.train[i + 1] : nullptr;
    const bool has_next = next && next->track == frame.track && next->time > frame.time;
    if (has_next) pairs.push_back({int(i), int(i) + 1});
    if (!frame.flow_path.empty() && !(has_next && next->camera == frame.camera))
      pairs.push_back({int(i), -1});
  }
  return pairs;
}

std::vector<FlowPair> pairs_in_time(const Scene& scene) {
  std::map<double, int> by_time;
  for (size_t i = 0; i < scene.train.size(); ++i)
    if (!by_time.emplace(scene.train[i].time, int(i)).second)
      throw Error(fmt::format(
          "flow.pairs is \"time\", which needs one picture at a time, but scene {} has {} and "
          "another at time {}",
          scene.name, scene.train[i].name, scene.train[i].time));
  std::vector<FlowPair> pairs;
  for (auto at = by_time.begin(); at != by_time.end() && std::next(at) != by_time.end(); ++at)
    pairs.push_back({at->second, std::next(at)->second});
  return pairs;
}

bool leads_back(const Scene& scene, const FlowPair& pair) {
  return pair.next >= 0 &&
         scene.train[size_t(pair.next)].time < scene.train[size_t(pair.frame)].time;
}

std::vector<FlowPair> reversed(const std::vector<FlowPair>& pairs) {
  std::vector<FlowPair> back;
  for (const FlowPair& pair : pairs)
    if (pair.next >= 0) back.push_back({pair.next, pair.frame});
  return back;
}

}  // namespace gflow
