// SPDX-License-Identifier: Apache-2.0
// Panoptic Studio scenes as stored by Dynamic 3D Gaussians. A meta file has w, h [px] and for each
// time t and camera c: k[t][c] (3x3), w2c[t][c] (4x4 world-to-camera, OpenCV axes), fn[t][c] (the
// image in ims/) and cam_id[t][c].
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "optim/formats/npz.hpp"
#include "optim/images/image_header.hpp"
#include "optim/scene/json_file.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "optim/scene/readers/readers.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

constexpr double panoptic_fps = 30;  // of the recordings

struct MetaFile {
  std::string path;
  Json json;
  double width = 0, height = 0;  // [px]
  size_t times = 0;
};

MetaFile read_meta(const std::string& path) {
  MetaFile file{path, read_json(path)};
  file.width = needed_number(file.json, "w", path);
  file.height = needed_number(file.json, "h", path);
  const Json& names = member(file.json, "fn", path);
  if (!names.is_array()) throw Error(fmt::format("'fn' of {} is not a list of times", path));
  file.times = names.size();
  for (size_t t = 0; t < file.times; ++t)
    if (!names[t].is_array())
      throw Error(fmt::format("'fn' of {} has no list of cameras at time {}", path, t));
  for (const char* key : {"k", "w2c", "cam_id"}) {
    const Json& list = member(file.json, key, path);
    if (!list.is_array() || list.size() != file.times)
      throw Error(
          fmt::format("'{}' of {} is not a list of {} times like 'fn'", key, path, file.times));
    for (size_t t = 0; t < file.times; ++t)
      if (!list[t].is_array() || list[t].size() != names[t].size())
        throw Error(fmt::format("'{}' of {} has another number of cameras than 'fn' at time {}",
                                key, path, t));
  }
  return file;
}

Camera camera_of(const MetaFile& file, size_t t, size_t c, const std::string& image,
                 const ImageHeader& header) {
  const auto what = [&](const char* key) {
    return fmt::format("'{}' of camera {} at time {} of {}", key, c, t, file.path);
  };
  const Eigen::MatrixXd k = matrix(file.json["k"][t][c], 3, 3, what("k"));
  const Eigen::MatrixXd w2c = pose_rows(file.json["w2c"][t][c], what("w2c"));
  const double skew = 1e-6 * std::fabs(k(0, 0));  // [px per unit of y]
  if (std::fabs(k(0, 1)) > skew || k(1, 0) != 0 || k(2, 0) != 0 || k(2, 1) != 0 || k(2, 2) != 1)
    throw Error(fmt::format(
        "{} is not of the form [fx 0 cx; 0 fy cy; 0 0 1]: cameras with skew are not supported",
        what("k")));
  Camera camera;
  set_size(camera, file.width, file.height, file.path);
  camera.fx = k(0, 0), camera.fy = k(1, 1), camera.cx = k(0, 2), camera.cy = k(1, 2);
  const Eigen::Matrix3d rotation = w2c.leftCols(3).transpose();
  camera.viewmat = viewmat_from_pose(rotation, -rotation * w2c.col(3), what("w2c"));
  return fitted_to(camera, header.width, header.height, file.path, image);
}

// The file in folder/sub/ named by the meta file. Error if it is missing.
std::string file_in(const std::string& folder, const char* sub, const std::string& name,
                    const MetaFile& meta) {
  const std::string path = path_inside((fs::path(folder) / sub).string(), name, meta.path);
  if (!fs::is_regular_file(path))
    throw Error(fmt::format("{} lists image '{}', but there is no file {}", meta.path, name, path));
  return path;
}

// The mask of an image in seg/. The scenes of Dynamic 3D Gaussians have none of test cameras, which
// training on the foreground does not need.
std::string mask_of(const std::string& folder, const std::string& image, const MetaFile& meta,
                    Masks meaning) {
  const std::string name = fs::path(image).replace_extension(".png").string();
  if (fs::exists(fs::path(folder) / "seg" / name)) return file_in(folder, "seg", name, meta);
  if (meaning == Masks::foreground) return "";
  throw Error(fmt::format(
      "{} lists image '{}', but there is no mask {}: scene.masks = foreground needs masks of "
      "training images only",
      meta.path, image, (fs::path(folder) / "seg" / name).string()));
}

// The Panoptic Studio has 511 cameras.
int camera_number(const Json& value, const std::string& what) {
  constexpr int most = 1000000;
  const double id = value.is_number_integer() ? value.get<double>() : -1;
  if (!(id >= 0 && id <= most))
    throw Error(fmt::format("{} is not an integer from 0 to {}", what, most));
  return int(id);
}

std::vector<Frame> read_split(const std::string& folder, const std::string& path,
                              const SceneOptions& options, Scene& scene) {
  const MetaFile meta = read_meta(path);
  std::vector<Frame> frames;
  std::map<std::string, std::string> owners;  // image -> its camera and time
  for (size_t t = 0; t < meta.times; ++t) {
    std::set<int> cameras;  // at this time
    for (size_t c = 0; c < meta.json["fn"][t].size(); ++c) {
      const std::string what = fmt::format("camera {} at time {} of {}", c, t, path);
      const std::string name = text(meta.json["fn"][t][c], "'fn' of " + what);
      const int id = camera_number(meta.json["cam_id"][t][c], "'cam_id' of " + what);
      if (!cameras.insert(id).second)
        throw Error(
            fmt::format("'cam_id' of {} is {}, which another camera has at this time", what, id));
      const auto [owner, is_first] = owners.emplace(fs::path(name).lexically_normal(), what);
      if (!is_first)
        throw Error(fmt::format("{} has image '{}', which is already that of {}", what, name,
                                owner->second));
      Frame frame;
      frame.path = file_in(folder, "ims", name, meta);
      if (options.masks != Masks::automatic && options.masks != Masks::none)
        frame.mask_path = mask_of(folder, name, meta, options.masks);
      frame.track = id;
      frame.step = int(t);
      frame.time = meta.times > 1 ? double(t) / double(meta.times - 1) : 0;
      frame.name = fmt::format("cam{:02}_{:04}", frame.track, t);
      const ImageHeader header = read_image_header(frame.path);
      scene.has_alpha |= header.has_alpha || options.masks == Masks::alpha;
      Camera camera = camera_of(meta, t, c, frame.path, header);
      camera.name = fmt::format("cam{:02}", frame.track);
      frame.camera = find_or_add(scene.cameras, camera);
      frames.push_back(frame);
    }
  }
  return frames;
}

// init_pt_cld.npz: 'data' [n, 7] or [n, 6]: x y z, red green blue (full_intensity), segment.
PointCloud read_points(const std::string& folder, std::vector<std::string>& notices) {
  const std::string path = (fs::path(folder) / "init_pt_cld.npz").string();
  if (!fs::exists(path)) return find_points(folder, notices);
  const Arrays arrays = read_npz(path, {"data"});
  const Array& data = array_named(arrays, "data", path);
  if (data.shape.size() != 2 || data.shape[1] < 6)
    throw Error(
        fmt::format("'data' of {} has shape {}, expected (points, 7)", path, data.shape_text()));
  const size_t count = data.shape[0], columns = data.shape[1];
  PointCloud points;
  points.source = path;
  points.xyz.reserve(3 * count);
  points.rgb.reserve(3 * count);
  const auto add = [&](size_t i, const auto* row, double full) {
    for (int c = 0; c < 6; ++c)
      if (!(std::fabs(row[c]) <= farthest_point))
        throw Error(fmt::format("point {} of {} has a value that is NaN, Inf or beyond {:g}", i,
                                path, farthest_point));
    points.xyz.insert(points.xyz.end(), {double(row[0]), double(row[1]), double(row[2])});
    for (int c = 3; c < 6; ++c)
      points.rgb.push_back(uint8_t(std::lround(255 * std::clamp(row[c] / full, 0., 1.))));
  };
  // Row by row, because converting all values would need more memory than the file.
  const auto add_all = [&](const auto& values) {
    double largest = 0;
    for (size_t i = 0; i < count; ++i)
      for (size_t c = 3; c < 6; ++c) largest = std::max(largest, double(values[i * columns + c]));
    for (size_t i = 0; i < count; ++i) add(i, &values[i * columns], full_intensity(largest));
  };
  if (const auto* floats = std::get_if<std::vector<float>>(&data.values))
    add_all(*floats);
  else if (const auto* doubles = std::get_if<std::vector<double>>(&data.values))
    add_all(*doubles);
  else
    throw Error(fmt::format("'data' of {} contains integers, expected floats", path));
  return points;
}

}  // namespace

bool is_panoptic(const std::string& folder) {
  return fs::exists(fs::path(folder) / "train_meta.json");
}

Scene read_panoptic(const std::string& folder, const SceneOptions& options) {
  const auto meta = [&](const char* name) { return (fs::path(folder) / name).string(); };
  Scene scene;
  scene.layout = "panoptic";
  scene.fps = panoptic_fps;
  scene.near_plane = 1;  // as in the code of Dynamic 3D Gaussians: nearer there are other cameras
  scene.train = read_split(folder, meta("train_meta.json"), options, scene);
  if (scene.train.empty()) throw Error(fmt::format("{} has no images", meta("train_meta.json")));
  scene.steps = scene.train.back().step + 1;
  if (fs::exists(meta("test_meta.json")))
    scene.test = read_split(folder, meta("test_meta.json"), options, scene);
  for (const Frame& frame : scene.test)
    if (frame.step >= scene.steps)
      throw Error(fmt::format("{} has more times than the {} of {}", meta("test_meta.json"),
                              scene.steps, meta("train_meta.json")));
  scene.points = read_points(folder, scene.notices);
  return scene;
}

}  // namespace gflow
