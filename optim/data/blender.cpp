// SPDX-License-Identifier: Apache-2.0
// D-NeRF / Blender scenes. transform_matrix is camera-to-world with OpenGL axes (y up, looking
// along -z): columns y and z change sign for ours.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "optim/data/image_header.hpp"
#include "optim/data/reader_util.hpp"
#include "optim/data/readers.hpp"
#include "optim/data/tracks.hpp"
#include "optim/io/atomic_file.hpp"
#include "runtime/error.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

using Json = nlohmann::json;

// A transforms file and where it is, for errors.
struct Transforms {
  std::string path;
  Json json;
};

Transforms load(const std::string& path) {
  const Bytes bytes = read_file(path);
  try {
    Json json = Json::parse(bytes.begin(), bytes.end());
    if (!json.is_object() || !json.contains("frames") || !json["frames"].is_array())
      throw Error(fmt::format("{} has no list 'frames'", path));
    return {path, std::move(json)};
  } catch (const Json::exception& cause) {
    throw Error(fmt::format("cannot read {}: it is no JSON ({})", path, cause.what()));
  }
}

std::optional<double> number(const Json& object, const char* key, const std::string& where) {
  if (!object.contains(key)) return std::nullopt;
  const Json& value = object[key];
  if (!value.is_number() || !std::isfinite(value.get<double>()))
    throw Error(fmt::format("'{}' of {} is no finite number", key, where));
  return value.get<double>();
}

// From the frame, else from the top of the file.
std::optional<double> number(const Transforms& file, const Json& frame, const char* key,
                             const std::string& where) {
  const auto own = number(frame, key, where);
  return own ? own : number(file.json, key, file.path);
}

Eigen::Matrix4d viewmat_of(const Json& frame, const std::string& where) {
  const std::string what = "transform_matrix of " + where;
  const auto bad = [&] { throw Error(what + " is not 4 rows of 4 finite numbers"); };
  if (!frame.contains("transform_matrix")) bad();
  const Json& rows = frame["transform_matrix"];
  if (!rows.is_array() || rows.size() < 3) bad();
  Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
  for (int r = 0; r < 3; ++r) {
    const Json& row = rows[size_t(r)];
    if (!row.is_array() || row.size() != 4) bad();
    for (int c = 0; c < 4; ++c) {
      if (!row[size_t(c)].is_number()) bad();  // NaN is no JSON number; null stands for it
      pose(r, c) = row[size_t(c)].get<double>();
    }
  }
  Eigen::Matrix3d rotation = pose.topLeftCorner<3, 3>();
  rotation.col(1) *= -1;
  rotation.col(2) *= -1;
  return viewmat_from_pose(rotation, pose.topRightCorner<3, 1>(), what);
}

std::string picture_of(const std::string& folder, const Transforms& file, const Json& frame,
                       const std::string& where) {
  if (!frame.contains("file_path") || !frame["file_path"].is_string())
    throw Error(where + " has no 'file_path'");
  const std::string relative = frame["file_path"].get<std::string>();
  const std::string base = path_inside(folder, relative, file.path);
  for (const char* extension : {"", ".png", ".jpg", ".jpeg", ".PNG", ".JPG"})
    if (fs::is_regular_file(base + extension)) return base + extension;
  throw Error(fmt::format("{} names the picture '{}', but there is no {} (nor .png, .jpg)",
                          file.path, relative, base));
}

Camera camera_of(const Transforms& file, const Json& frame, const std::string& where,
                 const std::string& picture, const ImageHeader& header) {
  Camera camera;
  camera.width = int(std::lround(number(file, frame, "w", where).value_or(header.width)));
  camera.height = int(std::lround(number(file, frame, "h", where).value_or(header.height)));
  if (camera.width < 1 || camera.height < 1)
    throw Error(fmt::format("{} has the size {}x{}", where, camera.width, camera.height));
  const auto fl_x = number(file, frame, "fl_x", where), fl_y = number(file, frame, "fl_y", where);
  const auto angle_x = number(file, frame, "camera_angle_x", where);
  if (!fl_x && !angle_x)
    throw Error(fmt::format("{} has neither 'camera_angle_x' nor 'fl_x'", where));
  if (!fl_x && !(*angle_x > 0 && *angle_x < M_PI))
    throw Error(fmt::format("'camera_angle_x' of {} is {}, expected is an angle within (0, pi)",
                            where, *angle_x));
  camera.fx = fl_x ? *fl_x : 0.5 * camera.width / std::tan(0.5 * *angle_x);
  camera.fy = fl_y ? *fl_y : camera.fx;
  camera.cx = number(file, frame, "cx", where).value_or(0.5 * camera.width);
  camera.cy = number(file, frame, "cy", where).value_or(0.5 * camera.height);
  camera.viewmat = viewmat_of(frame, where);
  return fitted_to(camera, header.width, header.height, file.path, picture);
}

// train/r_000 -> train_r_000
std::string frame_name(const std::string& folder, const std::string& picture) {
  fs::path relative = fs::path(picture).lexically_relative(folder).replace_extension();
  std::string name = relative.generic_string();
  std::replace(name.begin(), name.end(), '/', '_');
  return name;
}

std::vector<Frame> read_split(const std::string& folder, const std::string& split, Scene& scene) {
  const std::string path = (fs::path(folder) / ("transforms_" + split + ".json")).string();
  if (!fs::exists(path)) return {};
  const Transforms file = load(path);
  std::vector<Frame> frames;
  for (const Json& entry : file.json["frames"]) {
    const std::string where = fmt::format("frame {} of {}", frames.size(), path);
    if (!entry.is_object()) throw Error(where + " is no object");
    Frame frame;
    frame.path = picture_of(folder, file, entry, where);
    frame.time = number(entry, "time", where).value_or(0);
    if (frame.time < 0 || frame.time > 1)
      throw Error(fmt::format("'time' of {} is {}, expected is 0 to 1", where, frame.time));
    const ImageHeader header = read_image_header(frame.path);
    scene.has_alpha |= header.has_alpha;
    Camera camera = camera_of(file, entry, where, frame.path, header);
    frame.name = frame_name(folder, frame.path);
    camera.name = frame.name;
    frame.camera = find_or_add(scene.cameras, camera);
    frames.push_back(frame);
  }
  return frames;
}

std::vector<double> distinct_times(const std::vector<Frame>& frames) {
  std::vector<double> times;
  for (const Frame& frame : frames) times.push_back(frame.time);
  std::sort(times.begin(), times.end());
  times.erase(
      std::unique(times.begin(), times.end(), [](double a, double b) { return b - a < 1e-9; }),
      times.end());
  return times;
}

int nearest_step(const std::vector<double>& times, double time) {
  const auto nearer = [&](double a, double b) { return std::fabs(a - time) < std::fabs(b - time); };
  return int(std::min_element(times.begin(), times.end(), nearer) - times.begin());
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

Scene read_blender(const std::string& folder, const SceneOptions&) {
  Scene scene;
  scene.layout = "blender";
  scene.fps = 24;
  scene.train = read_split(folder, "train", scene);
  scene.test = read_split(folder, "test", scene);
  scene.val = read_split(folder, "val", scene);
  if (scene.train.empty())
    throw Error(fmt::format("{}/transforms_train.json has no frames", folder));

  const std::vector<double> times = distinct_times(scene.train);
  scene.steps = int(times.size());
  const double interval =
      times.size() > 1 ? (times.back() - times[0]) / double(times.size() - 1) : 1;
  for (auto* split : {&scene.train, &scene.test, &scene.val})
    for (Frame& frame : *split) frame.step = nearest_step(times, frame.time);
  add_truth(folder, "train", interval, scene.train);
  add_truth(folder, "test", interval, scene.test);
  add_truth(folder, "val", interval, scene.val);
  scene.points = find_points(folder);
  for (auto* split : {&scene.train, &scene.test, &scene.val}) find_tracks(scene, *split);
  return scene;
}

}  // namespace gflow
