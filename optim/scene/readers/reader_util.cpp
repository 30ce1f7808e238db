// SPDX-License-Identifier: Apache-2.0
// Helpers shared by the scene readers.
#include "optim/scene/readers/reader_util.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>

#include "optim/scene/readers/colmap_model.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/lower.hpp"
#include "runtime/base/printable.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

template <class Keep>
std::vector<std::string> list(const std::string& folder, Keep keep) {
  std::vector<std::string> names;
  std::error_code failed;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, failed)) {
    const std::string name = entry.path().filename().string();
    if (name[0] != '.' && keep(entry)) names.push_back(name);
  }
  std::sort(names.begin(), names.end(), natural_less);
  return names;
}

std::string as_upper(std::string text) {
  for (char& c : text) c = char(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

// In the order in which find_image prefers them.
const std::vector<std::string> image_extensions = {".png",  ".jpg", ".jpeg",
                                                   ".webp", ".tif", ".tiff"};
const std::vector<std::string> video_extensions = {".mp4", ".avi", ".mov", ".mkv", ".webm"};

bool has_extension(const fs::path& path, const std::vector<std::string>& known) {
  return std::count(known.begin(), known.end(), lower(path.extension().string())) > 0;
}

bool is_file_with(const fs::directory_entry& entry, const std::vector<std::string>& known) {
  return entry.is_regular_file() && has_extension(entry.path(), known);
}

// Absolute on this machine or on Windows, or above the folder.
bool leads_out(const fs::path& path) {
  const std::string text = path.string();
  const bool has_drive = text.size() > 1 && std::isalpha(uint8_t(text[0])) && text[1] == ':';
  return path.is_absolute() || has_drive || *path.begin() == "..";
}

// Scenes are moved after their files were written: the longest end of the path, such as
// images/0.png of /home/me/scene/images/0.png, that exists in the folder; empty if none does.
std::string end_of_path_inside(const std::string& folder, const fs::path& path) {
  for (auto from = path.begin(); from != path.end(); ++from) {
    if (*from == ".." || *from == path.root_directory()) continue;
    fs::path end(folder);
    for (auto part = from; part != path.end(); ++part) end /= *part;
    if (!find_image(end.string()).empty() || fs::exists(end)) return end.string();
  }
  return "";
}

// Whether a PLY has vertices with positions. A damaged file has none: nothing depends on it.
bool has_points(const std::string& path) {
  try {
    const std::vector<std::string> names = ply_vertex_properties(path);
    const auto has = [&](const char* name) { return std::count(names.begin(), names.end(), name); };
    return has("x") && has("y") && has("z");
  } catch (const Error&) {
    return false;
  }
}

bool is_digit(char c) { return c >= '0' && c <= '9'; }

}  // namespace

bool natural_less(const std::string& a, const std::string& b) {
  size_t i = 0, j = 0;
  while (i < a.size() && j < b.size()) {
    if (!is_digit(a[i]) || !is_digit(b[j])) {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i, ++j;
      continue;
    }
    while (i < a.size() && a[i] == '0') ++i;
    while (j < b.size() && b[j] == '0') ++j;
    size_t i_end = i, j_end = j;
    while (i_end < a.size() && is_digit(a[i_end])) ++i_end;
    while (j_end < b.size() && is_digit(b[j_end])) ++j_end;
    if (i_end - i != j_end - j) return i_end - i < j_end - j;
    const int order = a.compare(i, i_end - i, b, j, j_end - j);
    if (order != 0) return order < 0;
    i = i_end, j = j_end;
  }
  if ((i < a.size()) != (j < b.size())) return j < b.size();
  return a < b;  // "01" and "1": any fixed order
}

std::vector<std::string> list_images(const std::string& folder) {
  return list(folder, [](const auto& e) { return is_file_with(e, image_extensions); });
}

std::vector<std::string> list_images_below(const std::string& folder) {
  std::vector<std::string> names;
  std::error_code failed;
  fs::recursive_directory_iterator at(folder, fs::directory_options::skip_permission_denied,
                                      failed);
  for (; !failed && at != fs::recursive_directory_iterator(); at.increment(failed)) {
    const bool hidden = at->path().filename().string()[0] == '.';
    if (hidden) at.disable_recursion_pending();
    if (!hidden && is_file_with(*at, image_extensions))
      names.push_back(at->path().lexically_relative(folder).generic_string());
  }
  return names;
}

std::vector<std::string> list_folders(const std::string& folder) {
  return list(folder, [](const auto& e) { return e.is_directory(); });
}

bool has_video_extension(const std::string& path) { return has_extension(path, video_extensions); }

std::vector<std::string> list_videos(const std::string& folder) {
  return list(folder, [](const auto& e) { return is_file_with(e, video_extensions); });
}

std::string short_list(const std::vector<std::string>& names, size_t most) {
  const size_t shown = std::min(names.size(), most);
  std::string text = fmt::format("{}", fmt::join(names.begin(), names.begin() + long(shown), ", "));
  if (names.size() > most) text += fmt::format(" and {} more", names.size() - most);
  return text;
}

std::string with_slashes(std::string path) {
  std::replace(path.begin(), path.end(), '\\', '/');
  return path;
}

std::string path_inside(const std::string& folder, const std::string& relative,
                        const std::string& source) {
  constexpr size_t longest = 1024;  // longer names do not occur and would not fit a message
  const auto is_control = [](unsigned char c) { return c < 0x20 || c == 0x7f; };
  if (relative.size() > longest || std::any_of(relative.begin(), relative.end(), is_control))
    throw Error(
        fmt::format("{} names the file '{}': expected a relative path without control characters, "
                    "at most {} bytes long",
                    source, excerpt(relative), longest));
  const fs::path path = fs::path(with_slashes(relative)).lexically_normal();
  if (relative.empty()) throw Error(fmt::format("{} contains an empty file name", source));
  if (!leads_out(path)) return (fs::path(folder) / path).string();
  const std::string moved = end_of_path_inside(folder, path);
  if (moved.empty())
    throw Error(
        fmt::format("{} names the file '{}', which is outside of the scene folder; expected a "
                    "relative path inside it",
                    source, excerpt(relative)));
  return moved;
}

std::string first_existing(const std::string& folder, const std::vector<std::string>& names) {
  for (const std::string& name : names) {
    const fs::path path = fs::path(folder) / name;
    if (fs::exists(path)) return path.string();
  }
  return "";
}

std::string find_image(const std::string& base) {
  if (fs::is_regular_file(base)) return base;
  for (const std::string& extension : image_extensions) {
    const std::string upper = as_upper(extension);
    for (const std::string& path : {base + extension, base + upper})
      if (fs::is_regular_file(path)) return path;
  }
  return "";
}

std::string find_image_of_any_case(const std::string& base) {
  if (const std::string found = find_image(base); !found.empty()) return found;
  const fs::path path(base);
  const std::string folder = path.parent_path().string();
  const std::string wanted = lower(path.filename().string());
  for (const std::string& name : list_images(folder)) {
    const std::string other = lower(name);
    if (other == wanted || without_image_extension(other) == wanted) return join(folder, name);
  }
  return "";
}

void LeftOut::add(const std::string& entry) {
  if (count_++ == 0) first_ = excerpt(entry);
}

void LeftOut::report(size_t all, const std::string& source,
                     std::vector<std::string>& notices) const {
  if (count_ == 0) return;
  const std::string what =
      fmt::format("{} of {} frames {} (the first is '{}')", count_, all, why_, first_);
  if (2 * count_ > all) throw Error(fmt::format("{} lists {}", source, what));
  notices.push_back(fmt::format("{} lists {}; they are left out", source, what));
}

std::string join(const std::string& folder, const std::string& name) {
  return (fs::path(folder) / name).string();
}

std::string stem(const std::string& path) { return fs::path(path).stem().string(); }

std::string without_image_extension(const std::string& name) {
  const bool has_one = has_extension(name, image_extensions);
  return has_one ? fs::path(name).replace_extension().string() : name;
}

Numbered split_number(const std::string& stem) {
  size_t at = stem.size();
  while (at > 0 && is_digit(stem[at - 1])) --at;
  return {stem.substr(0, at), stem.substr(at)};
}

Eigen::Matrix4d viewmat_from_pose(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& position,
                                  const std::string& what) {
  if (!rotation.allFinite() || !position.allFinite())
    throw Error(fmt::format("{} contains NaN or Inf", what));
  const auto is_rotation = [](const Eigen::Matrix3d& r) {
    const double error = (r.transpose() * r - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
    return error < 1e-3 && r.determinant() > 0;
  };
  // A camera object that is scaled, as Blender allows, has a multiple of a rotation.
  const double scale = std::cbrt(rotation.determinant());
  const bool scaled = !is_rotation(rotation) && scale > 0;
  const Eigen::Matrix3d unit = scaled ? Eigen::Matrix3d(rotation / scale) : rotation;
  if (!is_rotation(unit))
    throw Error(fmt::format(
        "the 3x3 part of {} is not a rotation: its columns must be orthonormal and right-handed",
        what));
  const Eigen::Matrix3d exact = Eigen::Quaterniond(unit).normalized().toRotationMatrix();
  Eigen::Matrix4d viewmat = Eigen::Matrix4d::Identity();
  viewmat.topLeftCorner<3, 3>() = exact.transpose();
  viewmat.topRightCorner<3, 1>() = -exact.transpose() * position;
  return viewmat;
}

void set_size(Camera& camera, double width, double height, const std::string& where) {
  for (const double side : {width, height})
    if (!(side >= 1 && side < 1e6 && side == std::floor(side)))
      throw Error(fmt::format("{} gives the image size {}x{}, expected integers from 1 to 999999",
                              where, width, height));
  camera.width = int(width);
  camera.height = int(height);
}

Camera fitted_to(Camera camera, int width, int height, const std::string& source,
                 const std::string& image) {
  const double sx = double(width) / camera.width, sy = double(height) / camera.height;
  if (!(std::fabs(sx / sy - 1) < 0.02))
    throw Error(fmt::format(
        "image {} is {}x{}, but {} gives its camera the size {}x{}: the aspect ratios differ",
        image, width, height, source, camera.width, camera.height));
  camera.width = width;
  camera.height = height;
  for (double* x : {&camera.fx, &camera.cx, &camera.lens.fx, &camera.lens.cx}) *x *= sx;
  for (double* y : {&camera.fy, &camera.cy, &camera.lens.fy, &camera.lens.cy}) *y *= sy;
  return camera;
}

int find_or_add(std::vector<Camera>& cameras, const Camera& camera) {
  const auto same = [&](const Camera& other) {
    return other.width == camera.width && other.height == camera.height && other.fx == camera.fx &&
           other.fy == camera.fy && other.cx == camera.cx && other.cy == camera.cy &&
           other.lens == camera.lens && other.viewmat.isApprox(camera.viewmat, 1e-9);
  };
  const auto found = std::find_if(cameras.begin(), cameras.end(), same);
  if (found != cameras.end()) return int(found - cameras.begin());
  cameras.push_back(camera);
  return int(cameras.size()) - 1;
}

std::string find_points_ply(const std::string& folder) {
  return first_existing(folder, {"points3D.ply", "points3d.ply", "points_t0.ply", "fused.ply",
                                 "points3D_multipleview.ply", "points3D_downsample2.ply"});
}

void report_other_points(const std::string& folder, std::vector<std::string>& notices) {
  const auto is_ply = [](const auto& entry) { return is_file_with(entry, {".ply"}); };
  const std::vector<std::string> names = list(folder, is_ply);
  const auto other = std::find_if(names.begin(), names.end(), [&](const std::string& name) {
    return has_points(join(folder, name));
  });
  if (other != names.end())
    notices.push_back(
        fmt::format("the points of {} are not used: rename it to points3D.ply to start from them, "
                    "if they use the coordinate system of the cameras",
                    join(folder, *other)));
}

PointCloud find_points(const std::string& folder, std::vector<std::string>& notices) {
  const std::string ply = find_points_ply(folder);
  if (!ply.empty()) return read_point_cloud(ply);
  const std::string model = find_colmap_model(join(folder, "sparse"), notices);
  if (!model.empty()) return read_colmap_points(model);
  report_other_points(folder, notices);
  return {};
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

size_t nearest_time(const std::vector<double>& times, double time) {
  const auto next = std::lower_bound(times.begin(), times.end(), time);
  const bool is_before =
      next != times.begin() && (next == times.end() || time - next[-1] <= *next - time);
  return size_t(next - times.begin()) - size_t(is_before);
}

void set_steps(const std::vector<double>& times, std::vector<Frame>& frames) {
  for (Frame& frame : frames) frame.step = int(nearest_time(times, frame.time));
}

void find_true_flow(Frame& frame, const std::string& base, double flow_time) {
  frame.flow_path = first_existing("", {base + ".flo", base + ".flo.gz", base + ".png"});
  if (frame.flow_path.empty()) return;
  frame.flow_mask_path = first_existing("", {base + "_mask.png"});
  frame.flow_time = flow_time;
}

double median_distance(const PointCloud& points, const Eigen::Vector3d& from) {
  std::vector<double> distances;
  for (size_t i = 0; i < points.size(); ++i)
    distances.push_back((Eigen::Map<const Eigen::Vector3d>(&points.xyz[3 * i]) - from).norm());
  const auto median = distances.begin() + long(distances.size() / 2);
  std::nth_element(distances.begin(), median, distances.end());
  return *median;
}

double scene_extent(const Scene& scene) {
  std::vector<bool> used(scene.cameras.size());
  for (const Frame& frame : scene.train) used[size_t(frame.camera)] = true;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  double n = 0;
  for (size_t i = 0; i < used.size(); ++i)
    if (used[i]) mean += scene.cameras[i].position(), ++n;
  mean /= n;
  double radius = 0;
  for (size_t i = 0; i < used.size(); ++i)
    if (used[i]) radius = std::max(radius, (scene.cameras[i].position() - mean).norm());
  if (radius > 1e-6 * (1 + mean.norm())) return 1.1 * radius;

  // One camera: its median distance from the points, or its distance from the origin.
  if (scene.points.size() == 0) return mean.norm() > 1e-6 ? mean.norm() : 1;
  return std::max(median_distance(scene.points, mean), 1e-6);
}

}  // namespace gflow
