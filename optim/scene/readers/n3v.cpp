// SPDX-License-Identifier: Apache-2.0
// Plenoptic video (N3V) scenes, with poses of LLFF (llff_poses.hpp). Only time steps that all
// cameras have are used.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>

#include "optim/images/image_header.hpp"
#include "optim/images/video.hpp"
#include "optim/scene/similarity.hpp"
#include "optim/scene/camera_settings.hpp"
#include "optim/scene/depth_map.hpp"
#include "optim/scene/readers/colmap_points.hpp"
#include "optim/scene/readers/llff_poses.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "optim/scene/readers/readers.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

constexpr double n3v_fps = 30;  // of the N3V recordings

// Images of one camera by step key: a file stem, or the number of a video frame.
struct Footage {
  std::string name;
  std::string file;  // name of its folder, image or video
  int width = 0, height = 0;
  std::map<std::string, std::string> images;  // stem -> path
  std::string video;                          // replaces images if not empty
  int video_frames = 0;
  std::vector<double> video_times;  // [s] from 0; empty if they are not known
  double fps = n3v_fps;
  bool variable = false;  // the intervals between the video's frames differ
  bool alpha = false;
};

Footage from_images(const std::string& name, const std::string& folder) {
  Footage footage;
  footage.name = footage.file = name;
  for (const std::string& file : list_images(folder))
    footage.images[stem(file)] = join(folder, file);
  const ImageHeader header = read_image_header(footage.images.begin()->second);
  footage.width = header.width;
  footage.height = header.height;
  footage.alpha = header.has_alpha;
  return footage;
}

Footage from_video(const std::string& name, const std::string& path) {
  const VideoInfo info = video_info(path);
  Footage footage;
  footage.name = name;
  footage.file = fs::path(path).filename().string();
  footage.width = info.width;
  footage.height = info.height;
  footage.video = path;
  footage.video_frames = info.frames;
  footage.video_times = info.times;
  footage.fps = info.fps;
  footage.variable = info.variable;
  footage.alpha = info.alpha;
  return footage;
}

bool starts_with_cam(const std::string& name) { return name.compare(0, 3, "cam") == 0; }

// The folder with the images of camera folder camNN: options.images or images in it, else, if it
// is no video's, camNN itself (4DGaussians); empty if there are none.
std::string image_folder_of_camera(const std::string& folder, const std::string& name,
                                   const std::string& images, bool has_video) {
  const std::string camera = join(folder, name);
  const std::string inner = join(camera, images.empty() ? "images" : images);
  if (!list_images(inner).empty()) return inner;
  return images.empty() && !has_video && !list_images(camera).empty() ? camera : "";
}

// Images or a video per camera, by name; images/ is preferred if a camera has both.
std::vector<Footage> moving_footage(const std::string& folder, const SceneOptions& options) {
  std::map<std::string, std::string> image_folders, videos;
  for (const std::string& name : list_videos(folder))
    if (starts_with_cam(name)) videos[stem(name)] = join(folder, name);
  for (const std::string& name : list_folders(folder)) {
    if (!starts_with_cam(name)) continue;
    const std::string images =
        image_folder_of_camera(folder, name, options.images, videos.count(name) > 0);
    if (images.empty()) continue;
    image_folders[name] = images;
    videos.erase(name);
  }
  std::vector<std::string> names;
  for (const auto& entry : image_folders) names.push_back(entry.first);
  for (const auto& entry : videos) names.push_back(entry.first);
  std::sort(names.begin(), names.end(), natural_less);
  std::vector<Footage> footage;
  for (const std::string& name : names)
    footage.push_back(image_folders.count(name) ? from_images(name, image_folders[name])
                                                : from_video(name, videos[name]));
  return footage;
}

// Folder images or images_N: options.images, else the largest N, which has the smallest images.
std::string still_folder(const std::string& folder, const SceneOptions& options) {
  if (!options.images.empty()) return join(folder, options.images);
  std::string best;
  for (const std::string& name : list_folders(folder))
    if ((name == "images" || name.compare(0, 7, "images_") == 0) &&
        !list_images(join(folder, name)).empty())
      best = join(folder, name);  // natural order: the last has the largest N
  return best;
}

// One image per camera: a static scene of one step.
std::vector<Footage> still_footage(const std::string& folder, const SceneOptions& options,
                                   const LlffPoses& poses, std::vector<std::string>& notices) {
  std::vector<Footage> footage;
  const std::string image_folder = still_folder(folder, options);
  for (const std::string& file :
       images_with_poses(poses, image_folder, list_images(image_folder), notices)) {
    const std::string path = join(image_folder, file);
    const ImageHeader header = read_image_header(path);
    Footage one;
    one.name = stem(file);
    one.file = file;
    one.width = header.width;
    one.height = header.height;
    one.images["0000"] = path;
    footage.push_back(one);
  }
  return footage;
}

Camera camera_of(const LlffPoses& poses, size_t row, const Footage& footage) {
  const double* const values = poses.row(row);
  const auto at = [&](int r, int c) { return values[5 * r + c]; };
  Eigen::Matrix3d rotation;
  for (int r = 0; r < 3; ++r) rotation.row(r) << at(r, 1), at(r, 0), -at(r, 2);
  const std::string what = fmt::format("row {} of {}", row, poses.path);
  for (int k = 0; k < 15; ++k)
    if (!std::isfinite(values[k])) throw Error(what + " contains NaN or Inf");
  const double height = at(0, 4), width = at(1, 4), focal = at(2, 4);
  if (!(height >= 1 && height < 1e6 && width >= 1 && width < 1e6 && focal > 0))
    throw Error(fmt::format("{} has height {}, width {} and focal length {}: all must be positive",
                            what, height, width, focal));
  Camera camera;
  camera.name = footage.name;
  camera.width = int(std::lround(width));
  camera.height = int(std::lround(height));
  camera.fx = camera.fy = focal;
  camera.cx = 0.5 * width;
  camera.cy = 0.5 * height;
  camera.viewmat = viewmat_from_pose(rotation, Eigen::Vector3d(at(0, 3), at(1, 3), at(2, 3)), what);
  const std::string image = footage.video.empty() ? footage.images.begin()->second : footage.video;
  return fitted_to(camera, footage.width, footage.height, poses.path, image);
}

// Widens the depth range of the scene by that of a row. False if it is unknown.
bool add_depths(const LlffPoses& poses, size_t row, Scene& scene) {
  const double near = poses.row(row)[15], far = poses.row(row)[16];
  if (near == 0 && far == 0) return false;
  if (!(near > 0 && far > near && std::isfinite(far)))
    throw Error(fmt::format(
        "row {} of {} has depth bounds {} and {}: expected 0 < near < far, or 0 and 0 if unknown",
        row, poses.path, near, far));
  scene.near = scene.far > 0 ? std::min(scene.near, near) : near;
  scene.far = std::max(scene.far, far);
  return true;
}

// Stems common to all cameras with images, in natural order; "0000", "0001", ... if all are videos.
std::vector<std::string> common_steps(const std::vector<Footage>& footage,
                                      const std::string& folder) {
  int shortest = -1;
  std::vector<std::string> steps;
  bool first = true;
  for (const Footage& one : footage) {
    if (!one.video.empty()) {
      shortest = shortest < 0 ? one.video_frames : std::min(shortest, one.video_frames);
      continue;
    }
    if (first)
      for (const auto& entry : one.images) steps.push_back(entry.first);
    first = false;
    steps.erase(std::remove_if(steps.begin(), steps.end(),
                               [&](const std::string& s) { return !one.images.count(s); }),
                steps.end());
  }
  std::sort(steps.begin(), steps.end(), natural_less);
  if (first)
    for (int k = 0; k < shortest; ++k) steps.push_back(fmt::format("{:04}", k));
  else if (shortest >= 0 && steps.size() > size_t(shortest))
    steps.resize(size_t(shortest));
  if (steps.empty())
    throw Error(
        fmt::format("the cameras of {} have no frame in common: images of one time step must have "
                    "the same name",
                    folder));
  return steps;
}

// A warning if some cameras have more time steps than all have in common.
std::vector<std::string> unused_steps(const std::vector<Footage>& footage, size_t used) {
  size_t most = used;
  std::vector<std::string> shortest;
  for (const Footage& one : footage) {
    const size_t own = one.video.empty() ? one.images.size() : size_t(one.video_frames);
    most = std::max(most, own);
    if (own == used) shortest.push_back(one.name);
  }
  if (most == used) return {};
  const std::string why = shortest.empty() ? "the names of the other images differ"
                                           : fmt::format("{} {} no more", fmt::join(shortest, ", "),
                                                         shortest.size() > 1 ? "have" : "has");
  return {
      fmt::format("using only the {} of {} time steps that all cameras have: {}", used, most, why)};
}

// Whether frames of equal number are of different times: videos of variable or different frame
// rates.
bool have_own_times(const std::vector<Footage>& footage) {
  const double fps = footage[0].fps;
  return std::all_of(footage.begin(), footage.end(),
                     [](const Footage& one) { return !one.video_times.empty(); }) &&
         std::any_of(footage.begin(), footage.end(), [&](const Footage& one) {
           return one.variable || std::fabs(one.fps - fps) > 1e-3 * fps;
         });
}

// Times in [0, 1] of the frames of a video until `end` [s].
std::vector<double> times_until(const Footage& footage, double end) {
  std::vector<double> times;
  constexpr double rounding = 1e-6;
  for (const double time : footage.video_times)
    if (int(times.size()) < footage.video_frames && time <= end + rounding)
      times.push_back(end > 0 ? std::min(time / end, 1.) : 0);
  return times;
}

// times: of the steps, in [0, 1].
std::vector<Frame> frames_of(const std::string& folder, int camera, const Footage& footage,
                             const std::vector<std::string>& steps,
                             const std::vector<double>& times) {
  std::vector<Frame> frames;
  const double interval = 1 / std::max(1., double(steps.size()) - 1);
  for (size_t k = 0; k < steps.size(); ++k) {
    Frame frame;
    frame.camera = frame.track = camera;
    frame.step = int(k);
    frame.time = times[k];
    frame.name = fmt::format("{}_{:04}", footage.name, k);
    if (footage.video.empty())
      frame.path = footage.images.at(steps[k]);
    else
      frame.path = footage.video, frame.video_frame = int(k);
    find_true_flow(frame, join(folder, "flow/" + footage.name + "/" + steps[k]),
                   k + 1 < times.size() ? times[k + 1] : 1 + interval);
    frame.depth_path = find_depth(join(folder, "depth/" + footage.name + "/" + steps[k]));
    frames.push_back(frame);
  }
  return frames;
}

// Frames of all cameras at the time steps that all have.
std::vector<std::vector<Frame>> frames_in_step(const std::string& folder,
                                               const std::vector<Footage>& footage, Scene& scene) {
  const std::vector<std::string> steps = common_steps(footage, folder);
  for (const std::string& notice : unused_steps(footage, steps.size()))
    scene.notices.push_back(notice);
  scene.steps = int(steps.size());
  std::vector<double> times;
  const double last = std::max(1., double(steps.size()) - 1);
  for (size_t k = 0; k < steps.size(); ++k) times.push_back(double(k) / last);
  std::vector<std::vector<Frame>> frames;
  for (size_t i = 0; i < footage.size(); ++i)
    frames.push_back(frames_of(folder, int(i), footage[i], steps, times));
  return frames;
}

// Frames of videos at their own times, until the first one ends. The time steps are those of the
// video with most frames.
std::vector<std::vector<Frame>> frames_at_own_times(const std::string& folder,
                                                    const std::vector<Footage>& footage,
                                                    Scene& scene) {
  scene.notices.push_back(
      fmt::format("the videos of {} have variable or different frame rates: their frames are used "
                  "at their own times, counted from the first frame of each",
                  folder));
  double end = footage[0].video_times.back();
  for (const Footage& one : footage) end = std::min(end, one.video_times.back());
  std::vector<double> step_times;
  std::vector<std::vector<Frame>> frames;
  for (size_t i = 0; i < footage.size(); ++i) {
    const std::vector<double> times = times_until(footage[i], end);
    if (times.size() > step_times.size()) step_times = times;
    std::vector<std::string> names;
    for (size_t k = 0; k < times.size(); ++k) names.push_back(fmt::format("{:04}", k));
    frames.push_back(frames_of(folder, int(i), footage[i], names, times));
  }
  for (std::vector<Frame>& of_camera : frames) set_steps(step_times, of_camera);
  scene.steps = int(step_times.size());
  if (end > 0) scene.fps = double(scene.steps - 1) / end;
  return frames;
}

// A COLMAP model of the same cameras may have its own coordinate system, as in the published
// recordings. Its points are then aligned to that of poses_bounds.npy, by three images or more that
// are named like cameras, else by the order of the images if there are as many as cameras.
// The model of 4DGaussians in sparse_/ uses that of poses_bounds_multipleview.npy.
PointCloud read_points(const std::string& folder, const LlffPoses& poses,
                       const std::vector<Camera>& cameras, std::vector<std::string>& notices) {
  const std::string ply = find_points_ply(folder);
  if (!ply.empty()) return read_point_cloud(ply);
  if (poses.is_multipleview())
    if (const std::string model = find_colmap_model(join(folder, "sparse_"), notices);
        !model.empty())
      return read_colmap_points(model);
  const std::string poses_file = fs::path(poses.path).filename().string();
  const std::string folder_of_model = find_colmap_model(join(folder, "sparse"), notices);
  if (folder_of_model.empty()) return {};
  if (!is_colmap_model(folder_of_model)) return read_colmap_points(folder_of_model);
  ColmapModel model = read_colmap_model(folder_of_model);
  if (model.points.size() == 0) return {};
  std::vector<ColmapImage> ours;
  for (const Camera& camera : cameras) ours.push_back({camera.name, camera});
  auto [from, to] = common_cameras(model.images, ours);
  if (from.size() < 3) {
    if (model.images.size() != cameras.size() || cameras.size() < 2) {
      notices.push_back(
          fmt::format("the points of COLMAP model {} are used as they are: its images are not "
                      "named like the cameras of {}",
                      folder_of_model, poses_file));
      return model.points;
    }
    from.clear();
    for (const ColmapImage& image : model.images) from.push_back(image.camera);
    to = cameras;
  }
  if (align_points(model.points, from, to)) return model.points;
  notices.push_back(
      fmt::format("the points of COLMAP model {} are not used: its cameras do not agree with those "
                  "of {}",
                  folder_of_model, poses_file));
  return {};
}

Error no_images(const std::string& folder, const LlffPoses& poses, const SceneOptions& options) {
  const std::string images = options.images.empty() ? "images" : options.images;
  return Error(fmt::format("{} has {} but no images: looked for camNN/{}/, {}camNN.mp4 and {}/",
                           folder, fs::path(poses.path).filename().string(), images,
                           options.images.empty() ? "camNN/, " : "", images));
}

}  // namespace

bool is_n3v(const std::string& folder) { return !find_llff_poses(folder).empty(); }

Scene read_n3v(const std::string& folder, const SceneOptions& options) {
  const LlffPoses poses = read_llff_poses(find_llff_poses(folder));
  Scene scene;
  scene.layout = "n3v";
  std::vector<Footage> footage = moving_footage(folder, options);
  if (footage.empty()) footage = still_footage(folder, options, poses, scene.notices);
  if (footage.empty()) throw no_images(folder, poses, options);
  const int n = int(footage.size());
  if (options.holdout < -1 || options.holdout >= n)
    throw Error(fmt::format("scene.holdout is {}, but {} has cameras 0 to {} (-1: no test camera)",
                            options.holdout, folder, n - 1));
  std::vector<LlffCamera> found;
  for (const Footage& one : footage) found.push_back({one.name, one.file});
  const auto [rows, skipped] =
      assign_rows(poses, folder, found, options.skip_cameras, scene.notices);
  std::vector<Camera> all;
  // Before the steps that all cameras have: one to skip may be too short.
  std::vector<Footage> used;
  int test_camera = -1;
  bool has_depths = true;
  for (size_t i = 0; i < footage.size(); ++i) {
    if (rows[i] < 0) continue;
    all.push_back(camera_of(poses, size_t(rows[i]), footage[i]));
    has_depths = has_depths && add_depths(poses, size_t(rows[i]), scene);
    if (skipped[i]) continue;
    if (int(i) == options.holdout) test_camera = int(used.size());
    used.push_back(footage[i]);
    scene.cameras.push_back(all.back());
  }
  scene.points = read_points(folder, poses, all, scene.notices);
  if (scene.points.size() == 0) report_other_points(folder, scene.notices);
  footage = used;
  scene.fps = footage[0].fps;
  const std::vector<std::vector<Frame>> all_frames =
      have_own_times(footage) ? frames_at_own_times(folder, footage, scene)
                              : frames_in_step(folder, footage, scene);
  for (size_t i = 0; i < footage.size(); ++i) {
    const std::vector<Frame>& frames = all_frames[i];
    std::vector<Frame>& split = int(i) == test_camera ? scene.test : scene.train;
    split.insert(split.end(), frames.begin(), frames.end());
    scene.has_alpha |= footage[i].alpha;
  }
  if (options.holdout >= 0 && test_camera < 0)
    scene.notices.push_back(
        fmt::format("scene.skip_cameras leaves out the test camera {}: there are no test views",
                    found[size_t(options.holdout)].name));
  return scene;
}

}  // namespace gflow
