// SPDX-License-Identifier: Apache-2.0
// COLMAP models. An image's quaternion (w x y z) and translation are world-to-camera with OpenCV
// axes. COLMAP's pixel centres are at (i + .5, j + .5) too, so intrinsics need no shift. Counts in
// binary files are checked against the bytes left before memory is allocated.
#include "optim/scene/readers/colmap_model.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>
#include <set>

#include "optim/scene/lens.hpp"
#include "optim/scene/readers/colmap_files.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"

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

// Limit on cameras and images: each takes some hundred bytes, and no real scene has more.
constexpr size_t most_entries = 100000;

void require_modest(size_t entries, const char* what, const std::string& path) {
  if (entries > most_entries)
    throw Error(fmt::format("cannot read {}: it has more than {} {}, the limit for a scene", path,
                            most_entries, what));
}

template <class Number>
bool is_number(std::string_view word) {
  Number number;
  const auto read = std::from_chars(word.data(), word.data() + word.size(), number);
  return read.ec != std::errc::invalid_argument && read.ptr == word.data() + word.size();
}

// Whether the line is a list of observations: x, y and a point id each. Ids may be written as reals
// unless `strict`.
bool is_observations(ColmapText& file, bool strict) {
  size_t numbers = 0;
  for (auto word = file.word(); !word.empty(); word = file.word(), ++numbers)
    if (strict && numbers % 3 == 2 ? !is_number<int64_t>(word) : !is_number<double>(word))
      return !file.is_whole();
  return !file.is_whole() || numbers % 3 == 0;
}

// Skips the line of an image's observations and goes to the next image; false at the end of the
// file. After a blank line, which is an empty list, the observations may still follow. Error if the
// line is anything else, such as another image.
bool skip_observations(ColmapText& file, const std::string& path, const std::string& image) {
  if (!file.next_line()) return false;
  const bool blank = file.is_blank();
  if (blank && !file.next_entry()) return false;
  if (is_observations(file, blank)) return file.next_entry();
  file.restart_line();
  if (blank) return true;
  throw Error(
      fmt::format("cannot read {}: the line after image {} is not a list of observations X Y "
                  "POINT3D_ID; each image needs two lines, of which the second may be empty",
                  path, excerpt(image)));
}

// COLMAP's camera models. Parameters are one or two focal lengths, the principal point, then
// distortion coefficients, stored at these indices of Lens::k.
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
      fmt::format("{} has a camera of model {}, but gflow only reads {}; undistort the images with "
                  "colmap image_undistorter",
                  path, excerpt(name), names));
}

// p: the parameters in COLMAP's order.
Camera make_camera(const CameraModel& model, double width, double height,
                   const std::vector<double>& p, const std::string& path) {
  if (width < 1 || height < 1 || width > 1 << 20 || height > 1 << 20)
    throw Error(fmt::format("{} has a camera of {}x{} pixels, expected sides of 1 to {}", path,
                            width, height, 1 << 20));
  Camera camera;
  camera.width = int(width);
  camera.height = int(height);
  const size_t n = model.focal_lengths;
  camera.fx = p[0], camera.fy = p[n - 1], camera.cx = p[n], camera.cy = p[n + 1];
  std::array<double, 8> k = {};
  for (size_t i = 0; i < model.places.size(); ++i) k[model.places[i]] = p[n + 2 + i];
  return pinhole_of_lens(camera, model.kind, k, "a camera in " + path);
}

std::vector<double> room_for_parameters(const CameraModel& model) {
  return std::vector<double>(model.focal_lengths + 2 + model.places.size());
}

using Cameras = std::map<uint32_t, Camera>;

void add_camera(Cameras& cameras, uint32_t id, const Camera& camera, const std::string& path) {
  if (!cameras.emplace(id, camera).second)
    throw Error(fmt::format("{} has camera {} twice; camera ids must be unique", path, id));
}

Cameras cameras_bin(const std::string& path) {
  ColmapBinary file(path);
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
  file.require_end();
  return cameras;
}

Cameras cameras_txt(const std::string& path) {
  Cameras cameras;
  ColmapText file(path, "CAMERA_ID MODEL WIDTH HEIGHT PARAMETERS");
  while (file.next_entry()) {
    const auto id = file.number<uint32_t>("the camera id");
    const std::string name(file.word());
    const auto width = file.number<int64_t>("the width"),
               height = file.number<int64_t>("the height");
    const CameraModel& model = model_named(name, path);
    std::vector<double> parameters = room_for_parameters(model);
    for (double& value : parameters)
      value = file.number<double>(
          fmt::format("one of the {} parameters of {}", parameters.size(), model.name).c_str());
    if (!file.rest().empty())
      file.refuse(fmt::format("has more than the {} parameters of its model {}", parameters.size(),
                              model.name));
    add_camera(cameras, id, make_camera(model, double(width), double(height), parameters, path),
               path);
    require_modest(cameras.size(), "cameras", path);
  }
  return cameras;
}

// An image as it is stored.
struct StoredImage {
  std::string name;
  double q[4], t[3];
  uint32_t camera_id;
};

ColmapImage make_image(const StoredImage& stored, const Cameras& cameras, const std::string& path) {
  const auto& [name, q, t, camera_id] = stored;
  const auto found = cameras.find(camera_id);
  if (found == cameras.end())
    throw Error(fmt::format("{} assigns image {} to camera {}, which is not in the model", path,
                            excerpt(name), camera_id));
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  if (!std::isfinite(q[0] + q[1] + q[2] + q[3] + t[0] + t[1] + t[2]))
    throw Error(fmt::format("the pose of image {} in {} contains NaN or Inf", excerpt(name), path));
  if (!(length > 1e-6 && length < 1e6))
    throw Error(fmt::format("the quaternion of image {} in {} has length {:.3g}, expected 1",
                            excerpt(name), path, length));
  ColmapImage image{with_slashes(name), found->second};
  image.camera.name = image.name;
  image.camera.viewmat.topLeftCorner<3, 3>() =
      Eigen::Quaterniond(q[0], q[1], q[2], q[3]).normalized().toRotationMatrix();
  image.camera.viewmat.topRightCorner<3, 1>() = Eigen::Vector3d(t[0], t[1], t[2]);
  return image;
}

void require_new(std::set<uint32_t>& known, uint32_t id, const std::string& path) {
  if (!known.insert(id).second)
    throw Error(fmt::format("{} has image {} twice; image ids must be unique", path, id));
}

std::vector<StoredImage> images_bin(const std::string& path) {
  ColmapBinary file(path);
  std::vector<StoredImage> images;
  const uint64_t count = file.next_count(64);
  require_modest(count, "images", path);
  std::set<uint32_t> known;
  for (uint64_t n = count; n > 0; --n) {
    require_new(known, file.next<uint32_t>(), path);
    StoredImage& image = images.emplace_back();
    for (double& value : image.q) value = file.next<double>();
    for (double& value : image.t) value = file.next<double>();
    image.camera_id = file.next<uint32_t>();
    image.name = file.next_name();
    file.skip(file.next_count(24), 24);  // x, y, point id
  }
  file.require_end();
  return images;
}

std::vector<StoredImage> images_txt(const std::string& path) {
  std::vector<StoredImage> images;
  std::set<uint32_t> known;
  ColmapText file(path, "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, and a line of observations");
  for (bool more = file.next_entry(); more;) {
    require_new(known, file.number<uint32_t>("the image id"), path);
    StoredImage& image = images.emplace_back();
    for (double& value : image.q) value = file.number<double>("a quaternion component");
    for (double& value : image.t) value = file.number<double>("a translation component");
    image.camera_id = file.number<uint32_t>("the camera id");
    image.name = file.rest();
    if (image.name.empty()) file.refuse("ends before the image name");
    require_modest(images.size(), "images", path);
    more = skip_observations(file, path, image.name);
  }
  return images;
}

// Appends a point; counts it in left_out instead if it has no place.
void append_point(PointCloud& points, const double xyz[3], const int rgb[3],
                  const std::string& path, size_t& left_out) {
  for (int i = 0; i < 3; ++i)
    if (rgb[i] < 0 || rgb[i] > 255)
      throw Error(fmt::format("point {} of {} has colour {} {} {}, expected values of 0 to 255",
                              points.size() + left_out, path, rgb[0], rgb[1], rgb[2]));
  const bool placed =
      std::all_of(xyz, xyz + 3, [](double x) { return std::fabs(x) <= farthest_point; });
  left_out += !placed;
  if (!placed) return;
  points.xyz.insert(points.xyz.end(), xyz, xyz + 3);
  for (int i = 0; i < 3; ++i) points.rgb.push_back(uint8_t(rgb[i]));
}

PointCloud room_for_points(size_t count) {
  PointCloud points;
  points.xyz.reserve(3 * count);
  points.rgb.reserve(3 * count);
  return points;
}

PointCloud points_bin(const std::string& path) {
  ColmapBinary file(path);
  const uint64_t count = file.next_count(43 + 8);
  PointCloud points = room_for_points(count);
  size_t left_out = 0;
  for (uint64_t n = count; n > 0; --n) {
    file.next<uint64_t>();  // point id
    double xyz[3];
    int rgb[3];
    for (double& value : xyz) value = file.next<double>();
    for (int& value : rgb) value = file.next<uint8_t>();
    file.next<double>();               // reprojection error
    file.skip(file.next_count(8), 8);  // track: image id, point index
    append_point(points, xyz, rgb, path, left_out);
  }
  file.require_end();
  report_left_out_points(left_out, size_t(count), path);
  return points;
}

// Upper bound on the number of points in a text file; the shortest line is "1 0 0 0 0 0 0".
size_t room_in_lines(const std::string& path) {
  FilePieces file(path);
  const size_t most = file.left() / 14 + 1;
  size_t lines = 0;
  while (file.skip_line()) ++lines;
  return std::min(lines, most);
}

PointCloud points_txt(const std::string& path) {
  PointCloud points = room_for_points(room_in_lines(path));
  size_t left_out = 0;
  ColmapText file(path, "POINT3D_ID X Y Z R G B ERROR TRACK");
  while (file.next_entry()) {
    file.number<uint64_t>("the point id");
    double xyz[3];
    int rgb[3];
    for (double& value : xyz) value = file.number<double>("a coordinate");
    for (int& value : rgb) value = file.number<int>("a colour component");
    append_point(points, xyz, rgb, path, left_out);
  }
  report_left_out_points(left_out, points.size() + left_out, path);
  return points;
}

// NAME.bin or NAME.txt in a folder; empty if there is neither.
std::string found_file(const std::string& folder, const std::string& name) {
  return first_existing(folder, {name + ".bin", name + ".txt"});
}

std::string needed_file(const std::string& folder, const std::string& name) {
  const std::string path = found_file(folder, name);
  if (path.empty())
    throw Error(fmt::format("COLMAP model {} has neither {}.bin nor {}.txt", folder, name, name));
  return path;
}

bool is_binary(const std::string& path) { return fs::path(path).extension() == ".bin"; }

std::vector<StoredImage> stored_images(const std::string& path) {
  return is_binary(path) ? images_bin(path) : images_txt(path);
}

// The folders of all models. `sparse` itself is the first, because it is written last, from one of
// the others.
std::vector<std::string> model_folders(const std::string& sparse) {
  std::vector<std::string> folders;
  if (is_colmap_model(sparse)) folders.push_back(sparse);
  for (const std::string& name : list_folders(sparse))
    if (name.find_first_not_of("0123456789") == std::string::npos &&
        is_colmap_model(join(sparse, name)))
      folders.push_back(join(sparse, name));
  return folders;
}

}  // namespace

bool is_colmap_model(const std::string& folder) {
  return !found_file(folder, "cameras").empty() && !found_file(folder, "images").empty();
}

bool has_colmap_model(const std::string& sparse) {
  return fs::is_directory(join(sparse, "0")) || !model_folders(sparse).empty();
}

std::string find_colmap_model(const std::string& sparse, std::vector<std::string>& notices) {
  const std::vector<std::string> folders = model_folders(sparse);
  if (folders.empty()) return fs::is_directory(join(sparse, "0")) ? join(sparse, "0") : "";
  if (folders.size() == 1) return folders[0];
  std::vector<size_t> counts;
  for (const std::string& folder : folders)
    counts.push_back(stored_images(needed_file(folder, "images")).size());
  const size_t best = size_t(std::max_element(counts.begin(), counts.end()) - counts.begin());
  std::string others;
  for (size_t i = 0; i < folders.size(); ++i)
    if (i != best)
      others += fmt::format("{}{} with {}", others.empty() ? "" : ", ", folders[i], counts[i]);
  notices.push_back(fmt::format("using COLMAP model {} with {} registered images; not used: {}",
                                folders[best], counts[best], others));
  return folders[best];
}

std::string find_sparse(const std::string& scene) {
  // COLMAP; 3DGS's convert.py before it undistorts; nerfstudio; instant-ngp
  for (const char* name : {"sparse", "distorted/sparse", "colmap/sparse", "colmap_sparse"})
    if (const std::string sparse = join(scene, name); has_colmap_model(sparse)) return sparse;
  return "";
}

PointCloud read_colmap_points(const std::string& folder) {
  std::string path = found_file(folder, "points3D");
  if (!path.empty()) {
    PointCloud points = is_binary(path) ? points_bin(path) : points_txt(path);
    points.source = path;
    return points;
  }
  path = first_existing(folder, {"points3D.ply"});
  return path.empty() ? PointCloud{} : read_point_cloud(path);
}

ColmapModel read_colmap_model(const std::string& folder) {
  const std::string cameras_path = needed_file(folder, "cameras");
  const std::string images_path = needed_file(folder, "images");
  const Cameras cameras =
      is_binary(cameras_path) ? cameras_bin(cameras_path) : cameras_txt(cameras_path);
  ColmapModel model;
  for (const StoredImage& image : stored_images(images_path))
    model.images.push_back(make_image(image, cameras, images_path));
  if (model.images.empty()) throw Error(fmt::format("{} has no images", images_path));
  std::sort(model.images.begin(), model.images.end(),
            [](const auto& a, const auto& b) { return natural_less(a.name, b.name); });
  model.points = read_colmap_points(folder);
  return model;
}

}  // namespace gflow
