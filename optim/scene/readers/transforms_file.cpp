// SPDX-License-Identifier: Apache-2.0
// transform_matrix is camera-to-world with OpenGL axes (y up, looking along -z); columns y and z
// are negated to get OpenCV axes.
#include "optim/scene/readers/transforms_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <initializer_list>
#include <limits>
#include <map>

#include "optim/images/image_header.hpp"
#include "optim/scene/lens.hpp"
#include "optim/scene/readers/colmap_points.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

// A number of the frame, else of the whole file.
std::optional<double> inherited(const Transforms& file, const Json& frame, const char* key,
                                const std::string& where) {
  const auto own = number(frame, key, where);
  return own ? own : number(file.json, key, file.path);
}

Eigen::Matrix4d viewmat_of(const Json& frame, const std::string& where) {
  const std::string what = "transform_matrix of " + where;
  Eigen::MatrixXd pose = pose_rows(member(frame, "transform_matrix", where), what);
  pose.middleCols(1, 2) *= -1;
  return viewmat_from_pose(pose.leftCols(3), pose.col(3), what);
}

// The image of a frame, or empty if there is none.
std::string image_path(const std::string& folder, const Transforms& file, const Json& frame,
                       const std::string& where) {
  const std::string relative = text(member(frame, "file_path", where), "'file_path' of " + where);
  const std::string base = path_inside(folder, relative, file.path);
  if (fs::is_directory(base))
    throw Error(fmt::format("{} lists image '{}', but {} is a folder", file.path, relative, base));
  return find_image_of_any_case(base);
}

// Whether the pose has numbers only: programs write NaN for images that they could not place.
bool is_placed(const Json& frame) {
  if (!frame.contains("transform_matrix") || !frame["transform_matrix"].is_array()) return true;
  for (const Json& row : frame["transform_matrix"])
    if (row.is_array() &&
        std::any_of(row.begin(), row.end(), [](const Json& x) { return x.is_null(); }))
      return false;
  return true;
}

// The file of 'mask_path', or empty.
std::string mask_of(const std::string& folder, const Transforms& file, const Json& frame,
                    const std::string& where) {
  constexpr const char* key = "mask_path";
  if (!frame.contains(key)) return "";
  const std::string relative = text(frame[key], fmt::format("'{}' of {}", key, where));
  const std::string path = path_inside(folder, relative, file.path);
  if (!fs::is_regular_file(path))
    throw Error(
        fmt::format("{} lists {} '{}', but there is no file {}", file.path, key, relative, path));
  return path;
}

void notice_once(const std::string& sentence, std::vector<std::string>& notices) {
  if (std::find(notices.begin(), notices.end(), sentence) == notices.end())
    notices.push_back(sentence);
}

// The file of 'depth_file_path'; empty, with a notice, if it is missing: many data sets are passed
// on without their depth.
std::string depth_of(const std::string& folder, const Transforms& file, const Json& frame,
                     const std::string& where, std::vector<std::string>& notices) {
  constexpr const char* key = "depth_file_path";
  if (!frame.contains(key)) return "";
  const std::string relative = text(frame[key], fmt::format("'{}' of {}", key, where));
  const std::string path = path_inside(folder, relative, file.path);
  if (fs::is_regular_file(path)) return path;
  notice_once(
      fmt::format("some depth files that {} names do not exist and are left out", file.path),
      notices);
  return "";
}

// instant-ngp's flag for an equidistant lens, whose coefficients are those of OPENCV_FISHEYE.
bool is_fisheye(const Transforms& file, const Json& frame, const std::string& where) {
  const Json& holder = frame.contains("is_fisheye") ? frame : file.json;
  if (!holder.contains("is_fisheye")) return false;
  if (!holder["is_fisheye"].is_boolean())
    throw Error(fmt::format("'is_fisheye' of {} is not true or false", where));
  return holder["is_fisheye"].get<bool>();
}

// nerfstudio's camera models, which are COLMAP's. Without 'camera_model' OPENCV is assumed, or
// OPENCV_FISHEYE if 'is_fisheye' is true; missing coefficients are 0.
Camera with_lens(const Transforms& file, const Json& frame, const Camera& camera,
                 const std::string& where) {
  const Json& holder = frame.contains("camera_model") ? frame : file.json;
  const bool fisheye = is_fisheye(file, frame, where);
  const std::string model = holder.contains("camera_model")
                                ? text(holder["camera_model"], "'camera_model' of " + where)
                            : fisheye ? "OPENCV_FISHEYE"
                                      : "OPENCV";
  const auto is_one_of = [&](std::initializer_list<const char*> models) {
    return std::find(models.begin(), models.end(), model) != models.end();
  };
  const auto k = [&](const char* key) { return inherited(file, frame, key, where).value_or(0); };
  const std::string what = "the camera of " + where;
  if (is_one_of({"OPENCV_FISHEYE", "RADIAL_FISHEYE", "SIMPLE_RADIAL_FISHEYE"}))
    return pinhole_of_lens(camera, Lens::Kind::fisheye, {k("k1"), k("k2"), k("k3"), k("k4")}, what);
  if (!is_one_of({"SIMPLE_PINHOLE", "PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV"}))
    throw Error(fmt::format("{} has camera_model '{}', expected PINHOLE, OPENCV or OPENCV_FISHEYE",
                            where, excerpt(model)));
  if (fisheye)
    throw Error(fmt::format("{} has camera_model '{}', but 'is_fisheye' is true", where, model));
  return pinhole_of_lens(camera, Lens::Kind::radial,
                         {k("k1"), k("k2"), k("p1"), k("p2"), k("k3"), k("k4"), k("k5"), k("k6")},
                         what);
}

// Focal length along an axis [px]: fl_x, else by camera_angle_x, the field of view. Likewise y.
std::optional<double> focal_length(const Transforms& file, const Json& frame,
                                   const std::string& axis, int side, const std::string& where) {
  const std::string length_key = "fl_" + axis, angle_key = "camera_angle_" + axis;
  const auto length = inherited(file, frame, length_key.c_str(), where);
  if (length) return length;
  const auto angle = inherited(file, frame, angle_key.c_str(), where);
  if (!angle) return std::nullopt;
  if (!(*angle > 0 && *angle < M_PI))
    throw Error(
        fmt::format("'{}' of {} is {}, expected an angle in (0, pi)", angle_key, where, *angle));
  return 0.5 * side / std::tan(0.5 * *angle);
}

// Some programs write intrinsics divided by the width and the height.
void undo_division_by_size(const Transforms& file, const Json& frame, const std::string& where,
                           Camera& camera, std::vector<std::string>& notices) {
  constexpr double shortest = 5;  // focal length of any lens [px]
  const auto focal = inherited(file, frame, "fl_x", where);
  const auto cx = inherited(file, frame, "cx", where), cy = inherited(file, frame, "cy", where);
  if (!focal || *focal >= shortest || cx.value_or(0) > 1 || cy.value_or(0) > 1) return;
  camera.fx *= camera.width;
  camera.fy *= camera.height;
  if (cx) camera.cx *= camera.width;
  if (cy) camera.cy *= camera.height;
  notice_once(
      fmt::format("the focal lengths in {} are below {} px: they are taken to be divided by "
                  "the image size",
                  file.path, shortest),
      notices);
}

// Without 'w' and 'h' the intrinsics may be of larger images than those that are there. Twice the
// principal point is then their size, if it has the shape of the image.
void find_size_of_intrinsics(const Transforms& file, Camera& camera,
                             std::vector<std::string>& notices) {
  const double x = 2 * camera.cx / camera.width, y = 2 * camera.cy / camera.height;
  constexpr double off_centre = 0.25, same_shape = 0.02;
  if (!(x > 0 && std::fabs(x - 1) > off_centre && std::fabs(x / y - 1) < same_shape)) return;
  const int width = int(std::lround(2 * camera.cx)), height = int(std::lround(2 * camera.cy));
  notice_once(fmt::format("the principal point in {} is that of images of {}x{}, not of {}x{}: the "
                          "intrinsics are scaled",
                          file.path, width, height, camera.width, camera.height),
              notices);
  camera.width = width;
  camera.height = height;
}

Camera camera_of(const Transforms& file, const Json& frame, const std::string& where,
                 const std::string& image, int image_width, int image_height,
                 std::vector<std::string>& notices) {
  Camera camera;
  const auto width = inherited(file, frame, "w", where);
  const auto height = inherited(file, frame, "h", where);
  set_size(camera, width.value_or(image_width), height.value_or(image_height), where);
  const auto fx = focal_length(file, frame, "x", camera.width, where);
  const auto fy = focal_length(file, frame, "y", camera.height, where);
  if (!fx && !fy) throw Error(fmt::format("{} has neither 'camera_angle_x' nor 'fl_x'", where));
  camera.fx = fx ? *fx : *fy;
  camera.fy = fy ? *fy : *fx;
  camera.cx = inherited(file, frame, "cx", where).value_or(0.5 * camera.width);
  camera.cy = inherited(file, frame, "cy", where).value_or(0.5 * camera.height);
  camera.viewmat = viewmat_of(frame, where);
  undo_division_by_size(file, frame, where, camera, notices);
  if (!width && !height) find_size_of_intrinsics(file, camera, notices);
  return with_lens(file, frame, fitted_to(camera, image_width, image_height, file.path, image),
                   where);
}

void require_object(const Json& entry, const std::string& where) {
  if (!entry.is_object()) throw Error(where + " is not a JSON object");
}

// train/r_000 -> train_r_000
std::string frame_name(const std::string& folder, const std::string& image) {
  fs::path relative = fs::path(image).lexically_relative(folder).replace_extension();
  std::string name = relative.generic_string();
  std::replace(name.begin(), name.end(), '/', '_');
  return name;
}

}  // namespace

Transforms read_transforms(const std::string& path) {
  Transforms file{path, read_json(path)};
  if (!file.json.is_object() || !file.json.contains("frames") || !file.json["frames"].is_array())
    throw Error(fmt::format("{} has no list 'frames'", path));
  return file;
}

bool has_times(const Transforms& file) {
  const Json& frames = file.json["frames"];
  return !frames.empty() && frames[0].is_object() && frames[0].contains("time");
}

std::vector<Frame> read_frames(const std::string& folder, const Transforms& file,
                               const SceneOptions& options, Scene& scene) {
  std::vector<Frame> frames;
  std::map<std::string, size_t> known;  // image -> its frame
  LeftOut missing("without an image file"), unplaced("whose pose has NaN or Inf");
  size_t index = 0;
  for (const Json& entry : file.json["frames"]) {
    const std::string where = fmt::format("frame {} of {}", index++, file.path);
    require_object(entry, where);
    Frame frame;
    frame.path = image_path(folder, file, entry, where);
    if (frame.path.empty()) {
      missing.add(entry["file_path"].get<std::string>());
      continue;
    }
    if (!is_placed(entry)) {
      unplaced.add(entry["file_path"].get<std::string>());
      continue;
    }
    const auto [before, is_new] =
        known.emplace(fs::path(frame.path).lexically_normal().string(), index - 1);
    if (!is_new)
      throw Error(fmt::format("{} has image {}, which is already that of frame {}", where,
                              frame.path, before->second));
    if (options.masks != Masks::none) frame.mask_path = mask_of(folder, file, entry, where);
    frame.depth_path = depth_of(folder, file, entry, where, scene.notices);
    const auto time = number(entry, "time", where);
    if (time.has_value() != file.json["frames"][0].contains("time"))
      throw Error(fmt::format(
          "{} has {} 'time', but frame 0 has {}: either all frames must have 'time' or none", where,
          time ? "a" : "no", time ? "none" : "one"));
    frame.time = time.value_or(0);
    if (frame.time < 0)
      throw Error(fmt::format("'time' of {} is {}, expected 0 or more", where, frame.time));
    const ImageHeader header = read_image_header(frame.path);
    scene.has_alpha |=
        header.has_alpha || (!frame.mask_path.empty() && options.masks == Masks::alpha);
    Camera camera =
        camera_of(file, entry, where, frame.path, header.width, header.height, scene.notices);
    frame.name = frame_name(folder, frame.path);
    camera.name = frame.name;
    frame.camera = find_or_add(scene.cameras, camera);
    frames.push_back(frame);
  }
  missing.report(index, file.path, scene.notices);
  unplaced.report(index, file.path, scene.notices);
  return frames;
}

void normalise_times(const std::vector<std::vector<Frame>*>& splits, const std::string& source,
                     std::vector<std::string>& notices) {
  double first = std::numeric_limits<double>::max(), last = 0;
  for (const std::vector<Frame>* split : splits)
    for (const Frame& frame : *split)
      first = std::min(first, frame.time), last = std::max(last, frame.time);
  if (last <= 1) return;
  for (std::vector<Frame>* split : splits)
    for (Frame& frame : *split)
      frame.time = last > first ? (frame.time - first) / (last - first) : 0;
  notices.push_back(
      fmt::format("the times in {} are {} to {}: they are scaled to 0 to 1", source, first, last));
}

PointCloud points_beside(const std::string& folder, const std::string& source, Scene& scene) {
  const std::string ply = find_points_ply(folder);
  if (!ply.empty()) return read_point_cloud(ply);
  const std::string sparse = find_sparse(folder);
  if (sparse.empty()) return {};
  const std::string model = find_colmap_model(sparse, scene.notices);
  std::map<std::string, Camera> cameras;  // by image: splits may share images
  for (const std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val})
    for (const Frame& frame : *split)
      cameras.emplace(fs::path(frame.path).lexically_relative(folder).generic_string(),
                      scene.cameras[size_t(frame.camera)]);
  std::vector<ColmapImage> images;
  for (const auto& [name, camera] : cameras) images.push_back({name, camera});
  return points_in_world_of(images, source, model, scene.notices);
}

std::vector<Camera> read_cameras(const Transforms& file, int width, int height,
                                 const std::string& image, std::vector<std::string>& notices) {
  std::vector<Camera> cameras;
  for (const Json& entry : file.json["frames"]) {
    const std::string where = fmt::format("frame {} of {}", cameras.size(), file.path);
    require_object(entry, where);
    Camera camera = camera_of(file, entry, where, image, width, height, notices);
    if (entry.contains("file_path"))
      camera.name = with_slashes(text(entry["file_path"], "'file_path' of " + where));
    cameras.push_back(camera);
  }
  if (cameras.empty()) throw Error(fmt::format("{} has no frames", file.path));
  return cameras;
}

}  // namespace gflow
