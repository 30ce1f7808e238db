// SPDX-License-Identifier: Apache-2.0
// COLMAP models. An image's quaternion (w x y z) and translation are world-to-camera with our axes.
// COLMAP's pixel centres are at (i + .5, j + .5) as well, so intrinsics are taken as they are.
// Binary records have variable length, so every count is compared with the bytes that are left.
#include "optim/data/colmap_model.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <sstream>

#include "optim/data/lens.hpp"
#include "optim/data/reader_util.hpp"
#include "optim/io/file_pieces.hpp"
#include "optim/io/printable.hpp"
#include "runtime/error.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

const char* const model_names[] = {"SIMPLE_PINHOLE",
                                   "PINHOLE",
                                   "SIMPLE_RADIAL",
                                   "RADIAL",
                                   "OPENCV",
                                   "OPENCV_FISHEYE",
                                   "FULL_OPENCV",
                                   "FOV",
                                   "SIMPLE_RADIAL_FISHEYE",
                                   "RADIAL_FISHEYE",
                                   "THIN_PRISM_FISHEYE"};

// Each takes some hundred bytes of memory, and no scene has as many files.
constexpr size_t most_entries = 100000;

void require_modest(size_t entries, const char* what, const std::string& path) {
  if (entries > most_entries)
    throw Error(fmt::format("cannot read {}: it has more than {} {}, no scene has as many", path,
                            most_entries, what));
}

// Little-endian values of a binary file in order.
class BinaryFile {
 public:
  explicit BinaryFile(const std::string& path) : file_(path) {}

  template <class T>
  T next() {
    T value;
    const std::string_view bytes = file_.ahead(sizeof value);
    if (bytes.size() < sizeof value) truncated();
    std::memcpy(&value, bytes.data(), sizeof value);
    file_.step(sizeof value);
    return value;
  }
  std::string next_name() {
    std::string name;
    while (const char c = next<char>()) {
      name += c;
      if (name.size() > 4096)
        throw Error(fmt::format("{} has a picture whose name does not end", file_.path()));
    }
    return name;
  }
  // A number of records of at least `record` bytes.
  uint64_t next_count(size_t record) {
    const auto n = next<uint64_t>();
    need(n, record);
    return n;
  }
  void skip(uint64_t n, size_t record) {
    need(n, record);
    file_.step(n * record);
  }

 private:
  void need(uint64_t n, size_t record) const {
    if (n > file_.left() / record) truncated();
  }
  [[noreturn]] void truncated() const {
    throw Error(fmt::format("{} is truncated: it ends within its records", file_.path()));
  }

  FilePieces file_;
};

// The next line that is no comment; empty lines count. False at the end of the file.
bool next_entry(FilePieces& file, std::string& line) {
  constexpr const char* byte_order = "\xef\xbb\xbf";  // which some editors put before a text
  if (file.place() == 0 && file.ahead(3) == byte_order) file.step(3);
  while (file.ahead(1) == "#") file.skip_line();
  return file.next_line(line);
}

// The observations of a picture, which are not needed: x, y and a point's number, or none. Error
// when the line is something else, such as another picture.
void skip_observations(FilePieces& file, const std::string& picture) {
  std::string line;
  next_entry(file, line);
  const char *at = line.data(), *const end = at + line.size();
  const auto to_word = [&] {
    at = std::find_if(at, end, [](char c) { return c != ' ' && c != '\t'; });
  };
  size_t numbers = 0;
  bool sound = true;
  for (to_word(); at != end && sound; to_word(), ++numbers) {
    double number;
    const auto word = std::from_chars(at, end, number);
    sound = word.ec != std::errc::invalid_argument &&
            (word.ptr == end || *word.ptr == ' ' || *word.ptr == '\t');
    at = word.ptr;
  }
  const bool whole = line.size() < FilePieces::longest_line;  // else a word may be cut
  if (whole && (!sound || numbers % 3 != 0))
    throw Error(fmt::format(
        "cannot read {}: the line after that of picture {} is not x, y and point number of what "
        "was seen in it; each picture takes two lines, the second of which may be empty",
        file.path(), excerpt(picture)));
}

[[noreturn]] void bad_line(const std::string& path, const std::string& line) {
  throw Error(
      fmt::format("{} has a line that is not in COLMAP's format: '{}'", path, excerpt(line)));
}

// COLMAP's models with one or two focal lengths first, then the centre, then the coefficients at
// these places of Lens::k.
struct CameraModel {
  const char* name;
  size_t focal_lengths;
  Lens::Kind kind;
  std::vector<size_t> places;
};

const CameraModel& model_named(const std::string& name, const std::string& path) {
  using Kind = Lens::Kind;
  static const CameraModel known[] = {{"SIMPLE_PINHOLE", 1, Kind::none, {}},
                                      {"PINHOLE", 2, Kind::none, {}},
                                      {"SIMPLE_RADIAL", 1, Kind::radial, {0}},
                                      {"RADIAL", 1, Kind::radial, {0, 1}},
                                      {"OPENCV", 2, Kind::radial, {0, 1, 2, 3}},
                                      {"FULL_OPENCV", 2, Kind::radial, {0, 1, 2, 3, 4, 5, 6, 7}},
                                      {"SIMPLE_RADIAL_FISHEYE", 1, Kind::fisheye, {0}},
                                      {"RADIAL_FISHEYE", 1, Kind::fisheye, {0, 1}},
                                      {"OPENCV_FISHEYE", 2, Kind::fisheye, {0, 1, 2, 3}}};
  std::string names;
  for (const CameraModel& model : known) {
    if (model.name == name) return model;
    names += names.empty() ? model.name : std::string(", ") + model.name;
  }
  throw Error(
      fmt::format("{} has a camera of model {}, known are {}; undistort the pictures with colmap "
                  "image_undistorter",
                  path, excerpt(name), names));
}

// p: the parameters in COLMAP's order.
Camera make_camera(const CameraModel& model, double width, double height,
                   const std::vector<double>& p, const std::string& path) {
  if (width < 1 || height < 1 || width > 1 << 20 || height > 1 << 20)
    throw Error(fmt::format("{} has a camera of {}x{} pixels", path, width, height));
  Camera camera;
  camera.width = int(width);
  camera.height = int(height);
  const size_t n = model.focal_lengths;
  camera.fx = p[0], camera.fy = p[n - 1], camera.cx = p[n], camera.cy = p[n + 1];
  std::array<double, 8> k = {};
  for (size_t i = 0; i < model.places.size(); ++i) k[model.places[i]] = p[n + 2 + i];
  return behind_lens(camera, model.kind, k, "a camera in " + path);
}

std::vector<double> room_for_parameters(const CameraModel& model) {
  return std::vector<double>(model.focal_lengths + 2 + model.places.size());
}

using Cameras = std::map<uint32_t, Camera>;

void add_camera(Cameras& cameras, uint32_t id, const Camera& camera, const std::string& path) {
  if (!cameras.emplace(id, camera).second)
    throw Error(fmt::format("{} has the camera {} twice, each may be there once", path, id));
}

Cameras cameras_bin(const std::string& path) {
  BinaryFile file(path);
  Cameras cameras;
  const uint64_t count = file.next_count(24);
  require_modest(count, "cameras", path);
  for (uint64_t n = count; n > 0; --n) {
    const auto id = file.next<uint32_t>();
    const auto model_id = file.next<int32_t>();
    const bool named = model_id >= 0 && size_t(model_id) < std::size(model_names);
    const std::string name = named ? model_names[model_id] : fmt::format("number {}", model_id);
    const CameraModel& model = model_named(name, path);
    const auto width = file.next<uint64_t>(), height = file.next<uint64_t>();
    std::vector<double> parameters = room_for_parameters(model);
    for (double& value : parameters) value = file.next<double>();
    add_camera(cameras, id, make_camera(model, double(width), double(height), parameters, path),
               path);
  }
  return cameras;
}

Cameras cameras_txt(const std::string& path) {
  Cameras cameras;
  FilePieces file(path);
  for (std::string line; next_entry(file, line);) {
    if (line.empty()) continue;
    std::istringstream words(line);
    uint32_t id;
    std::string name;
    int64_t width, height;
    if (!(words >> id >> name >> width >> height)) bad_line(path, line);
    const CameraModel& model = model_named(name, path);
    std::vector<double> parameters = room_for_parameters(model);
    for (double& value : parameters)
      if (!(words >> value)) bad_line(path, line);
    if (!(words >> std::ws).eof())
      throw Error(
          fmt::format("{} has a camera with more than the {} parameters of its model {}: '{}'",
                      path, parameters.size(), model.name, excerpt(line)));
    add_camera(cameras, id, make_camera(model, double(width), double(height), parameters, path),
               path);
    require_modest(cameras.size(), "cameras", path);
  }
  return cameras;
}

ColmapImage make_image(const std::string& name, const double q[4], const double t[3],
                       uint32_t camera_id, const Cameras& cameras, const std::string& path) {
  const auto found = cameras.find(camera_id);
  if (found == cameras.end())
    throw Error(fmt::format("{} gives picture {} the camera {}, which is not in the model", path,
                            excerpt(name), camera_id));
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!(length > 1e-6) || !std::isfinite(length + t[0] + t[1] + t[2]))
    throw Error(fmt::format("the pose of picture {} in {} is not finite", excerpt(name), path));
  ColmapImage image{name, found->second};
  image.camera.name = name;
  image.camera.viewmat.topLeftCorner<3, 3>() =
      Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
  image.camera.viewmat.topRightCorner<3, 1>() = Eigen::Vector3d(t[0], t[1], t[2]);
  return image;
}

std::vector<ColmapImage> images_bin(const std::string& path, const Cameras& cameras) {
  BinaryFile file(path);
  std::vector<ColmapImage> images;
  const uint64_t count = file.next_count(64);
  require_modest(count, "pictures", path);
  for (uint64_t n = count; n > 0; --n) {
    file.next<uint32_t>();  // image id
    double q[4], t[3];
    for (double& value : q) value = file.next<double>();
    for (double& value : t) value = file.next<double>();
    const auto camera_id = file.next<uint32_t>();
    const std::string name = file.next_name();
    file.skip(file.next_count(24), 24);  // x, y, point id
    images.push_back(make_image(name, q, t, camera_id, cameras, path));
  }
  return images;
}

std::vector<ColmapImage> images_txt(const std::string& path, const Cameras& cameras) {
  std::vector<ColmapImage> images;
  FilePieces file(path);
  for (std::string line; next_entry(file, line);) {
    if (line.empty()) {
      while (next_entry(file, line))
        if (!line.empty())
          throw Error(fmt::format(
              "cannot read {}: where picture {} should be is an empty line; each takes two lines, "
              "the second of which may be empty",
              path, images.size() + 1));
      break;
    }
    std::istringstream words(line);
    uint32_t id, camera_id;
    double q[4], t[3];
    std::string name;
    words >> id;
    for (double& value : q) words >> value;
    for (double& value : t) words >> value;
    if (!(words >> camera_id >> std::ws) || !std::getline(words, name)) bad_line(path, line);
    images.push_back(make_image(name, q, t, camera_id, cameras, path));
    require_modest(images.size(), "pictures", path);
    skip_observations(file, name);
  }
  return images;
}

void append_point(PointCloud& points, const double xyz[3], const int rgb[3],
                  const std::string& path) {
  for (int i = 0; i < 3; ++i) {
    if (!(std::fabs(xyz[i]) <= farthest_point))
      throw Error(fmt::format("point {} of {} is not finite, or farther off than {:g}",
                              points.size(), path, farthest_point));
    if (rgb[i] < 0 || rgb[i] > 255)
      throw Error(fmt::format("point {} of {} has the colour {} {} {}, expected are 0 to 255",
                              points.size(), path, rgb[0], rgb[1], rgb[2]));
    points.xyz.push_back(xyz[i]);
    points.rgb.push_back(uint8_t(rgb[i]));
  }
}

PointCloud room_for_points(size_t count) {
  PointCloud points;
  points.xyz.reserve(3 * count);
  points.rgb.reserve(3 * count);
  return points;
}

PointCloud points_bin(const std::string& path) {
  BinaryFile file(path);
  const uint64_t count = file.next_count(43 + 8);
  PointCloud points = room_for_points(count);
  for (uint64_t n = count; n > 0; --n) {
    file.next<uint64_t>();  // point id
    double xyz[3];
    int rgb[3];
    for (double& value : xyz) value = file.next<double>();
    for (int& value : rgb) value = file.next<uint8_t>();
    file.next<double>();               // reprojection error
    file.skip(file.next_count(8), 8);  // track: image id, index there
    append_point(points, xyz, rgb, path);
  }
  return points;
}

// Points that the lines of a text are room for; none is shorter than "1 0 0 0 0 0 0".
size_t most_points(const std::string& path) {
  FilePieces file(path);
  const size_t most = file.left() / 14 + 1;
  size_t lines = 0;
  while (file.skip_line()) ++lines;
  return std::min(lines, most);
}

PointCloud points_txt(const std::string& path) {
  PointCloud points = room_for_points(most_points(path));
  FilePieces file(path);
  for (std::string line; next_entry(file, line);) {
    if (line.empty()) continue;
    std::istringstream words(line);
    uint64_t id;
    double xyz[3];
    int rgb[3];
    words >> id >> xyz[0] >> xyz[1] >> xyz[2] >> rgb[0] >> rgb[1] >> rgb[2];
    const bool whole = words.eof() || std::isspace(words.peek());  // 0x10 begins with a 0
    if (!words || !whole) bad_line(path, line);
    append_point(points, xyz, rgb, path);
  }
  return points;
}

// NAME.bin or NAME.txt in folder. Error when neither is there.
std::string model_file(const std::string& folder, const std::string& name) {
  const std::string path = first_existing(folder, {name + ".bin", name + ".txt"});
  if (path.empty())
    throw Error(fmt::format("COLMAP model {} has neither {}.bin nor {}.txt", folder, name, name));
  return path;
}

bool is_binary(const std::string& path) { return fs::path(path).extension() == ".bin"; }

}  // namespace

bool has_colmap_points(const std::string& folder) {
  return !first_existing(folder, {"points3D.bin", "points3D.txt"}).empty();
}

PointCloud read_colmap_points(const std::string& folder) {
  const std::string path = model_file(folder, "points3D");
  return is_binary(path) ? points_bin(path) : points_txt(path);
}

ColmapModel read_colmap_model(const std::string& folder) {
  const std::string cameras_path = model_file(folder, "cameras");
  const std::string images_path = model_file(folder, "images");
  const Cameras cameras =
      is_binary(cameras_path) ? cameras_bin(cameras_path) : cameras_txt(cameras_path);
  ColmapModel model;
  model.images =
      is_binary(images_path) ? images_bin(images_path, cameras) : images_txt(images_path, cameras);
  std::sort(model.images.begin(), model.images.end(),
            [](const auto& a, const auto& b) { return natural_less(a.name, b.name); });
  model.points = read_colmap_points(folder);
  return model;
}

}  // namespace gflow
