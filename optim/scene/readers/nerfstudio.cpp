// SPDX-License-Identifier: Apache-2.0
// nerfstudio scenes: one transforms file for all images.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

#include "optim/scene/readers/mask_files.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "optim/scene/readers/readers.hpp"
#include "optim/scene/readers/times_by_order.hpp"
#include "optim/scene/readers/transforms_file.hpp"
#include "optim/scene/tracks.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

// The images in the list `key`, such as 'train_filenames'; empty if there is no such list.
std::set<std::string> listed(const std::string& folder, const Transforms& file,
                             const std::string& key) {
  std::set<std::string> paths;
  if (!file.json.contains(key)) return paths;
  for (const std::string& name : texts(file.json[key], fmt::format("'{}' of {}", key, file.path)))
    paths.insert(path_inside(folder, name, file.path));
  return paths;
}

// Splits frames by the file's lists. Images in no list are for training if 'train_filenames' is
// missing. Without any list every n-th image by name is a test image.
void split_frames(const std::string& folder, const Transforms& file, int test_every,
                  const std::vector<Frame>& frames, Scene& scene) {
  struct List {
    const char* key;
    std::vector<Frame>& split;
    std::set<std::string> images;
  };
  List lists[] = {{"train_filenames", scene.train, {}},
                  {"test_filenames", scene.test, {}},
                  {"val_filenames", scene.val, {}}};
  std::map<std::string, const char*> owners;  // image -> its list
  for (List& list : lists) {
    list.images = listed(folder, file, list.key);
    for (const std::string& image : list.images)
      if (const auto [owner, is_first] = owners.emplace(image, list.key); !is_first)
        throw Error(
            fmt::format("{} lists {} in '{}' and in '{}'; each image may be in only one list",
                        file.path, image, owner->second, list.key));
    for (const Frame& frame : frames)
      if (list.images.count(frame.path)) list.split.push_back(frame);
    if (!list.images.empty() && list.split.empty())
      throw Error(fmt::format("none of the {} images in '{}' of {} is one of its {} frames",
                              list.images.size(), list.key, file.path, frames.size()));
  }
  if (!owners.empty()) {
    if (lists[0].images.empty())
      for (const Frame& frame : frames)
        if (!owners.count(frame.path)) scene.train.push_back(frame);
    return;
  }
  for (size_t i = 0; i < frames.size(); ++i)
    (test_every > 0 && i % size_t(test_every) == 0 ? scene.test : scene.train).push_back(frames[i]);
}

// nerfstudio moves the points of 'ply_file_path', by default sparse_pc.ply, to the world of the
// frames (its applied_transform). Files that lost that entry have these points still.
PointCloud points_of(const std::string& folder, const Transforms& file, Scene& scene) {
  const std::string unnamed = first_existing(folder, {"sparse_pc.ply"});
  const bool is_named = file.json.contains("ply_file_path");
  if (!is_named && !unnamed.empty() && find_points_ply(folder).empty())
    return read_point_cloud(unnamed);
  if (!is_named) return points_beside(folder, file.path, scene);
  const std::string relative = text(file.json["ply_file_path"], "'ply_file_path' of " + file.path);
  return read_point_cloud(path_inside(folder, relative, file.path));
}

}  // namespace

bool is_nerfstudio(const std::string& folder) {
  return fs::exists(fs::path(folder) / "transforms.json");
}

Scene read_nerfstudio(const std::string& folder, const SceneOptions& options) {
  const Transforms file = read_transforms((fs::path(folder) / "transforms.json").string());
  if (file.json["frames"].empty()) throw Error(fmt::format("{} has no frames", file.path));
  Scene scene;
  scene.layout = "nerfstudio";
  const double fps = number(file.json, "fps", file.path).value_or(0);
  scene.fps = fps >= slowest_fps && fps <= fastest_fps ? fps : 24;
  const auto estimated = file.json.find("estimated");  // written by `gflow cameras`
  scene.estimated_cameras = estimated != file.json.end() && *estimated == true;
  std::vector<Frame> frames = read_frames(folder, file, options, scene);
  if (options.times == Times::order)
    set_times_by_order(frames, file.path);
  else if (!has_times(file))
    report_video_names(frames, file.path, scene.notices);
  normalise_times({&frames}, file.path, scene.notices);
  std::stable_sort(frames.begin(), frames.end(),
                   [](const Frame& a, const Frame& b) { return natural_less(a.path, b.path); });
  split_frames(folder, file, options.test_every, frames, scene);
  if (scene.train.empty())
    throw Error(
        fmt::format("{} has no training images: all {} frames are test images, by its lists or by "
                    "scene.test_every = {}",
                    file.path, frames.size(), options.test_every));
  if (options.masks != Masks::none)
    report_unused_masks(folder, "no frame of transforms.json has a 'mask_path'", scene);
  const std::vector<double> times = distinct_times(scene.train);
  scene.steps = int(times.size());
  scene.points = points_of(folder, file, scene);
  if (scene.points.size() == 0) report_other_points(folder, scene.notices);
  for (auto* split : {&scene.train, &scene.test, &scene.val}) {
    set_steps(times, *split);
    if (options.times == Times::files) find_tracks(scene, *split);
  }
  return scene;
}

}  // namespace gflow
