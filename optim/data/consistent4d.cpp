// SPDX-License-Identifier: Apache-2.0
// Consistent4D scenes: one static camera that looks at the origin, z up. The camera is not in the
// files; it follows from elevation, radius and field of view.
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>

#include "optim/data/image_header.hpp"
#include "optim/data/reader_util.hpp"
#include "optim/data/readers.hpp"
#include "runtime/error.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

constexpr double degree = M_PI / 180;

bool is_number(const std::string& text) {
  return !text.empty() && std::all_of(text.begin(), text.end(),
                                      [](unsigned char c) { return std::isdigit(c) != 0; });
}

// Pictures of a folder that are named by a number only.
std::vector<std::string> numbered_pictures(const std::string& folder) {
  std::vector<std::string> names = list_pictures(folder);
  names.erase(std::remove_if(names.begin(), names.end(),
                             [](const std::string& name) { return !is_number(stem(name)); }),
              names.end());
  return names;
}

// Folder with the input view: input/ or the scene folder itself; empty when neither fits.
std::string input_folder(const std::string& folder) {
  const std::string input = (fs::path(folder) / "input").string();
  if (!numbered_pictures(input).empty()) return input;
  return numbered_pictures(folder).empty() ? "" : folder;
}

// Position r (cos el cos az, cos el sin az, sin el), looking at the origin.
Camera orbit_camera(const std::string& name, double azimuth, const SceneOptions& options,
                    const ImageHeader& header) {
  const double el = options.elevation * degree, az = azimuth * degree;
  const Eigen::Vector3d away(std::cos(el) * std::cos(az), std::cos(el) * std::sin(az),
                             std::sin(el));
  Eigen::Matrix3d rotation;
  rotation.col(2) = -away;
  rotation.col(0) = rotation.col(2).cross(Eigen::Vector3d::UnitZ()).normalized();
  rotation.col(1) = rotation.col(2).cross(rotation.col(0));
  Camera camera;
  camera.name = name;
  camera.width = header.width;
  camera.height = header.height;
  camera.fx = camera.fy = 0.5 * header.height / std::tan(0.5 * options.fov_y * degree);
  camera.cx = 0.5 * header.width;
  camera.cy = 0.5 * header.height;
  camera.viewmat = viewmat_from_pose(rotation, options.radius * away, "the camera of " + name);
  return camera;
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
  scene.cameras.push_back(orbit_camera(view, azimuth, options, header));
  return frames;
}

void check_options(const SceneOptions& options) {
  if (!(std::fabs(options.elevation) < 89.9))
    throw Error(fmt::format("the camera's elevation is {} degrees, possible is -89.9 to 89.9",
                            options.elevation));
  if (!(options.radius > 0) || !std::isfinite(options.radius))
    throw Error(
        fmt::format("the camera's distance is {}, expected is a positive number", options.radius));
  if (!(options.fov_y > 0 && options.fov_y < 180))
    throw Error(fmt::format("the camera's field of view is {} degrees, possible is 0 to 180",
                            options.fov_y));
}

}  // namespace

bool is_consistent4d(const std::string& folder) { return !input_folder(folder).empty(); }

Scene read_consistent4d(const std::string& folder, const SceneOptions& options) {
  check_options(options);
  Scene scene;
  scene.layout = "consistent4d";
  scene.fps = 24;
  scene.train = read_view(folder, input_folder(folder), "input", 0, options, scene);
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
