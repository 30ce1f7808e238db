// SPDX-License-Identifier: Apache-2.0
// Consistent4D scenes, and any folder of numbered pictures: one static camera that looks at the
// origin, z up. The camera is not in the files; it follows from elevation, radius and field of
// view.
#include <fmt/format.h>

#include <cctype>
#include <filesystem>
#include <set>

#include "optim/data/image_header.hpp"
#include "optim/data/reader_util.hpp"
#include "optim/data/readers.hpp"
#include "optim/data/static_camera.hpp"
#include "runtime/error.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

// How a picture is numbered: "frame_0012" is {"frame_", "0012"}; no number is an empty one.
struct Numbered {
  std::string prefix, number;
};

Numbered split_number(const std::string& stem) {
  size_t at = stem.size();
  while (at > 0 && std::isdigit(static_cast<unsigned char>(stem[at - 1]))) --at;
  return {stem.substr(0, at), stem.substr(at)};
}

// Pictures of a folder that are named by a number only; where there are none, those with a number
// behind one and the same word.
std::vector<std::string> numbered_pictures(const std::string& folder) {
  const std::vector<std::string> all = list_pictures(folder);
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

std::string join(const std::string& folder, const std::string& name) {
  return (fs::path(folder) / name).string();
}

// The frames of one view, in natural order of their names; `view` is input or eval_k.
std::vector<Frame> read_view(const std::string& folder, const std::string& pictures,
                             const std::string& view, double azimuth, const SceneOptions& options,
                             Scene& scene) {
  std::vector<Frame> frames;
  const std::vector<std::string> names = numbered_pictures(pictures);
  for (const std::string& name : names) {
    Frame frame;
    frame.path = (fs::path(pictures) / name).string();
    frame.camera = frame.track = int(scene.cameras.size());
    frame.step = int(frames.size());
    frame.time = names.size() > 1 ? double(frame.step) / double(names.size() - 1) : 0;
    frame.name = fmt::format("{}_{:04}", view, frame.step);
    const std::string number = fmt::format("{:04}", frame.step);
    const double next_time = double(frame.step + 1) / double(std::max<size_t>(names.size(), 2) - 1);
    find_true_flow(frame, (fs::path(folder) / "flow" / view / number).string(), next_time);
    frame.depth_path = first_existing(folder, {"depth/" + view + "/" + number + ".npy"});
    frames.push_back(frame);
  }
  const ImageHeader header = read_image_header(frames[0].path);
  scene.has_alpha |= header.has_alpha;
  scene.cameras.push_back(static_camera(view, azimuth, options, header.width, header.height));
  return frames;
}

}  // namespace

bool has_input_view(const std::string& folder) {
  return !numbered_pictures(join(folder, "input")).empty() && !is_colmap(folder);
}

bool has_numbered_pictures(const std::string& folder) { return !numbered_pictures(folder).empty(); }

Scene read_consistent4d(const std::string& folder, const SceneOptions& options) {
  const std::string input = has_input_view(folder) ? join(folder, "input") : folder;
  Scene scene;
  scene.layout = "consistent4d";
  scene.fps = 24;
  scene.train = read_view(folder, input, "input", 0, options, scene);
  scene.steps = int(scene.train.size());

  const double azimuths[] = {-75, 15, 105, 195};
  for (int k = 0; k < 4; ++k) {
    const std::string view = fmt::format("eval_{}", k);
    const std::string pictures = (fs::path(folder) / view).string();
    if (numbered_pictures(pictures).empty()) continue;
    const std::vector<Frame> frames =
        read_view(folder, pictures, view, azimuths[k], options, scene);
    if (frames.size() != scene.train.size())
      throw Error(fmt::format("{} has {} pictures, the input view has {}", pictures, frames.size(),
                              scene.train.size()));
    scene.test.insert(scene.test.end(), frames.begin(), frames.end());
  }
  if (scene.test.empty()) {
    scene.test = scene.train;
    for (Frame& frame : scene.test) frame.name = "test_" + frame.name;
  }
  scene.points = find_points(folder);
  return scene;
}

}  // namespace gflow
