// SPDX-License-Identifier: Apache-2.0
// Consistent4D scenes, and any folder of numbered images. The layout has no cameras. Unless cameras
// of the input view are given, all are static and look at the origin, z up, placed by azimuth,
// elevation, radius and field of view.
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <set>

#include "optim/images/image_header.hpp"
#include "optim/scene/depth_map.hpp"
#include "optim/scene/readers/given_cameras.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "optim/scene/readers/readers.hpp"
#include "optim/scene/readers/static_camera.hpp"
#include "optim/scene/readers/times_by_order.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

// The images of a folder named by a number only; if there are none, those with a common prefix
// before the number.
std::vector<std::string> numbered_images(const std::string& folder) {
  const std::vector<std::string> all = list_images(folder);
  std::vector<std::string> plain, named;
  std::set<std::string> prefixes;
  for (const std::string& name : all) {
    const Numbered parts = split_number(stem(name));
    if (parts.number.empty()) continue;
    (parts.prefix.empty() ? plain : named).push_back(name);
    prefixes.insert(parts.prefix);
  }
  if (!plain.empty()) return plain;
  return prefixes.size() == 1 ? named : std::vector<std::string>{};
}

// Moves and scales times so that the frames fill [0, 1].
void fill_time_range(std::vector<Frame>& frames) {
  const double first = frames.front().time, last = frames.back().time;
  const double length = last > first ? last - first : 1;
  for (Frame& frame : frames) {
    frame.time = (frame.time - first) / length;
    frame.flow_time = (frame.flow_time - first) / length;
  }
}

// The frames of one view in natural order of names; `view` is input or eval_k. The view has one
// camera, or one per image.
std::vector<Frame> read_view(const std::string& folder, const std::string& image_folder,
                             const std::string& view, std::optional<double> azimuth,
                             const SceneOptions& options, Scene& scene) {
  std::vector<Frame> frames;
  const std::vector<std::string> names = numbered_images(image_folder);
  const std::vector<double> times = times_of_names(names);
  const std::string first = join(image_folder, names[0]);
  const ImageHeader header = read_image_header(first);
  scene.has_alpha |= header.has_alpha;
  ViewCameras given;
  if (azimuth)
    given = {{static_camera(view, *azimuth, options, header.width, header.height)},
             std::vector<int>(names.size(), 0)};
  else
    given = cameras_of_view(
        options, {names.size(), names, true, header.width, header.height, first}, scene.notices);
  const int first_camera = int(scene.cameras.size());
  for (size_t k = 0; k < names.size(); ++k) {
    if (given.of_image[k] < 0) continue;
    Frame frame;
    frame.path = join(image_folder, names[k]);
    frame.camera = first_camera + given.of_image[k];
    frame.track = first_camera;
    frame.step = int(frames.size());
    frame.time = times[k];
    frame.name = fmt::format("{}_{:04}", view, k);
    const std::string number = fmt::format("{:04}", k);
    const double next_time =
        k + 1 < names.size() ? times[k + 1] : 1 + 1 / double(std::max<size_t>(k, 1));
    find_true_flow(frame, (fs::path(folder) / "flow" / view / number).string(), next_time);
    frame.depth_path = find_depth(join(folder, "depth/" + view + "/" + number));
    frames.push_back(frame);
  }
  scene.cameras.insert(scene.cameras.end(), given.cameras.begin(), given.cameras.end());
  return frames;
}

}  // namespace

bool has_input_view(const std::string& folder) {
  return !numbered_images(join(folder, "input")).empty() && !is_colmap(folder);
}

bool has_numbered_images(const std::string& folder) { return !numbered_images(folder).empty(); }

Scene read_consistent4d(const std::string& folder, const SceneOptions& options) {
  const std::string input = has_input_view(folder) ? join(folder, "input") : folder;
  Scene scene;
  scene.layout = "consistent4d";
  scene.fps = 24;
  scene.train = read_view(folder, input, "input", std::nullopt, options, scene);
  scene.steps = int(scene.train.size());
  const size_t images = numbered_images(input).size();
  const std::vector<double> times = distinct_times(scene.train);
  const bool given_one = !options.cameras.empty() && scene.cameras.size() == 1;

  const double azimuths[] = {-75, 15, 105, 195};
  for (int k = 0; k < 4; ++k) {
    const std::string view = fmt::format("eval_{}", k);
    const std::string image_folder = (fs::path(folder) / view).string();
    if (numbered_images(image_folder).empty()) continue;
    std::vector<Frame> frames = read_view(folder, image_folder, view, azimuths[k], options, scene);
    if (frames.size() != images)
      throw Error(fmt::format("{} has {} images, but the input view has {}", image_folder,
                              frames.size(), images));
    if (images > size_t(scene.steps)) set_steps(times, frames);
    const size_t shown = options.first_views ? 1 : 0;
    scene.train.insert(scene.train.end(), frames.begin(), frames.begin() + long(shown));
    scene.test.insert(scene.test.end(), frames.begin() + long(shown), frames.end());
  }
  if (options.first_views && scene.train.size() == size_t(scene.steps))
    throw Error(
        fmt::format("scene.first_views needs the first images of other views, but {} has "
                    "none in eval_0 to eval_3",
                    folder));
  if (scene.test.empty()) {
    report_no_poses(options, scene.notices);  // with views to test it is as the layout has it
    fill_time_range(scene.train);
    scene.test = scene.train;
    for (Frame& frame : scene.test) frame.name = "test_" + frame.name;
  }
  scene.points = find_points(folder, scene.notices);
  if (given_one && scene.points.size() == 0) scene.extent = options.radius;
  return scene;
}

}  // namespace gflow
