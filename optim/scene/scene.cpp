// SPDX-License-Identifier: Apache-2.0
// Recognises the layout of a scene and checks the result of its reader.
#include "optim/scene/scene.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string_view>

#include "optim/scene/camera_settings.hpp"
#include "optim/scene/depth_map.hpp"
#include "optim/scene/depths.hpp"
#include "optim/scene/held_back.hpp"
#include "optim/scene/readers/mask_files.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "optim/scene/readers/readers.hpp"
#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/file_name.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

enum Traits : unsigned {
  kNone = 0,
  kTakesCameras = 1,   // takes_cameras()
  kSkipsCameras = 2,   // the reader itself applies scene.skip_cameras
  kUsesTestEvery = 4,  // the reader chooses test images by scene.test_every
  kZIsUp = 8,          // is_z_up()
  kIsRig = 16,         // is_rig()
};

struct Layout {
  const char* name;
  const char* sign;  // files that it is recognised by, with its usual name; nullptr: not a folder
  bool (*is)(const std::string& path);
  Scene (*read)(const std::string& path, const SceneOptions& options);
  unsigned traits;
};

bool is_video(const std::string& path) { return fs::is_regular_file(path); }

// Most specific first: many folders contain transforms files or a COLMAP model in addition to the
// files of their layout, and numbered images occur anywhere.
constexpr Layout layouts[] = {
    {"video", nullptr, is_video, read_video_file, kTakesCameras},
    {"n3v", "poses_bounds.npy (N3V)", is_n3v, read_n3v, kSkipsCameras | kIsRig},
    {"panoptic", "train_meta.json (Panoptic)", is_panoptic, read_panoptic, kIsRig},
    {"nerfies", "dataset.json and metadata.json (nerfies)", is_nerfies, read_nerfies, kNone},
    {"consistent4d", "input/ (Consistent4D)", has_input_view, read_consistent4d, kTakesCameras},
    {"blender", "transforms_train.json (Blender, D-NeRF)", is_blender, read_blender, kZIsUp},
    {"nerfstudio", "transforms.json (nerfstudio)", is_nerfstudio, read_nerfstudio, kNone},
    {"colmap", "sparse/ or sparse/0/ (COLMAP)", is_colmap, read_colmap, kUsesTestEvery},
    {"consistent4d", "numbered images 0.png, 1.png, ...", has_numbered_images, read_consistent4d,
     kTakesCameras}};

// Whether layouts of that name have a trait. A scene in memory has no layout.
bool has_trait(std::string_view layout, Traits trait) {
  return std::any_of(std::begin(layouts), std::end(layouts), [&](const Layout& other) {
    return layout == other.name && (other.traits & trait) != 0;
  });
}

// "a, b and c": what folders are recognised by.
std::string signs_in_words() {
  std::string words;
  for (const Layout& layout : layouts) {
    const bool last = &layout == std::end(layouts) - 1;
    if (layout.sign)
      words += (words.empty() ? "" : last ? " and " : ", ") + std::string(layout.sign);
  }
  return words;
}

// The layout of a folder whose cameras have poses, or nullptr.
const Layout* layout_with_poses(const std::string& folder) {
  for (const Layout& layout : layouts)
    if (!takes_cameras(layout.name) && layout.is(folder)) return &layout;
  return nullptr;
}

// Scenes in folders up to two levels below, for the message about a folder that is none.
std::string scenes_below(const std::string& path) {
  std::string found;
  const auto look = [&](const std::string& folder) {
    const Layout* layout = fs::is_directory(folder) ? layout_with_poses(folder) : nullptr;
    if (layout) found += fmt::format("{}{} ({})", found.empty() ? "" : ", ", folder, layout->name);
    return layout != nullptr;
  };
  for (const std::string& name : list_folders(path)) {
    const std::string folder = join(path, name);
    if (look(folder)) continue;
    for (const std::string& inner : list_folders(folder)) look(join(folder, inner));
  }
  return found;
}

// Numbered images may be those of a scene in the folder above, whose poses would not be used.
void report_scene_above(const std::string& path, Scene& scene) {
  if (!takes_cameras(scene.layout) || !fs::is_directory(path)) return;
  const fs::path absolute = fs::absolute(path).lexically_normal();
  const fs::path folder = absolute.has_filename() ? absolute : absolute.parent_path();
  if (const Layout* layout = layout_with_poses(folder.parent_path().string()))
    scene.notices.push_back(fmt::format(
        "the folder above, {}, is a scene with camera poses ({}), which are not used: give that "
        "folder to use them",
        folder.parent_path().string(), layout->name));
}

Scene read_recognised(const std::string& path, const SceneOptions& options) {
  if (fs::exists(path) && !fs::is_directory(path)) require_file(path);
  for (const Layout& layout : layouts)
    if (layout.is(path)) {
      Scene scene = layout.read(path, options);
      if (options.cameras.empty()) report_scene_above(path, scene);
      return scene;
    }
  if (const std::string below = scenes_below(path); !below.empty())
    throw Error(fmt::format("{} has no known scene layout, but folders in it have: give one of {}",
                            path, below));
  throw Error(fmt::format(
      "{} has no known scene layout: looked for {}; for a video, give the path of the file", path,
      signs_in_words()));
}

void check(const SceneOptions& options) {
  if (options.first_step < 0)
    throw Error(fmt::format("scene.first_step is {}, expected 0 or more", options.first_step));
  if (options.stride < 1)
    throw Error(
        fmt::format("scene.stride is {}, expected 1 (all time steps) or more", options.stride));
  if (options.max_steps < 0)
    throw Error(fmt::format("scene.max_steps is {}, expected 0 (all time steps) or more",
                            options.max_steps));
}

// For messages. A scene in memory has no folder.
std::string place_of(const Scene& scene) {
  return scene.folder.empty() ? "the scene" : scene.folder;
}

// Keeps the selected steps and renumbers them 0, 1, ...; their times become 0 to 1.
void select_steps(Scene& scene, const SceneOptions& options) {
  const int first = options.first_step, stride = options.stride;
  if (first >= scene.steps)
    throw Error(fmt::format("scene.first_step is {}, but {} has {} time steps (counted from 0)",
                            first, place_of(scene), scene.steps));
  const int left = (scene.steps - 1 - first) / stride + 1;
  const int count = options.max_steps > 0 ? std::min(options.max_steps, left) : left;
  if (count == scene.steps) return;
  const auto unused = [&](const Frame& frame) {
    const int after = frame.step - first;
    return after < 0 || after % stride != 0 || after / stride >= count;
  };
  double begin = 1, end = 0;
  for (const Frame& frame : scene.train)
    if (!unused(frame)) begin = std::min(begin, frame.time), end = std::max(end, frame.time);
  const double length = end > begin ? end - begin : 1;
  constexpr double tolerance = 1e-9;
  for (std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val}) {
    split->erase(std::remove_if(split->begin(), split->end(), unused), split->end());
    for (Frame& frame : *split) {
      frame.step = (frame.step - first) / stride;
      frame.time = (frame.time - begin) / length;
      frame.flow_time = (frame.flow_time - begin) / length;
      const bool skips = stride > 1 && split == &scene.train;
      if (skips || frame.flow_time > 1 + tolerance)
        frame.flow_path.clear(), frame.flow_mask_path.clear(), frame.flow_time = 0;
    }
    // Drop views between two training times whose nearest step is used but whose time is out of
    // range.
    split->erase(std::remove_if(split->begin(), split->end(),
                                [&](const Frame& frame) {
                                  return frame.time < -tolerance || frame.time > 1 + tolerance;
                                }),
                 split->end());
  }
  scene.steps = count;
  scene.fps /= stride;
  scene.tracks_path.clear();  // tracks cover all steps, also those dropped
}

// Sorts the splits. Makes frame names valid as file names, and unique by appending a number.
void order_frames(Scene& scene) {
  std::set<std::string> names;
  std::map<std::string, int> used;  // last number appended to a name; none is tried twice
  for (std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val}) {
    std::stable_sort(split->begin(), split->end(), [](const Frame& a, const Frame& b) {
      return std::tie(a.track, a.time) < std::tie(b.track, b.time);
    });
    for (Frame& frame : *split) {
      const std::string name = as_file_name(frame.name);
      frame.name = name;
      while (!names.insert(frame.name).second)
        frame.name = fmt::format("{}_{}", name, ++used.try_emplace(name, 1).first->second);
    }
  }
}

// Camera values must be representable as floats, including squares of lengths and their products.
void check(const Scene& scene) {
  constexpr double most = 1e6, farthest = 1e12;
  const auto within = [](double focal, double side) {
    return focal >= side / most && focal <= side * most;
  };
  for (const Camera& camera : scene.cameras) {
    const double side = std::max(camera.width, camera.height);
    const bool ok = camera.width > 0 && camera.height > 0 && within(camera.fx, side) &&
                    within(camera.fy, side) && std::fabs(camera.cx) <= most * side &&
                    std::fabs(camera.cy) <= most * side;
    if (!ok)
      throw Error(
          fmt::format("camera {} of {} has size {}x{}, focal lengths {} and {} and principal point "
                      "({}, {}): sides must be positive, focal lengths 1e-6 to 1e6 times the "
                      "longer side, and the principal point within 1e6 times that side",
                      camera.name, place_of(scene), camera.width, camera.height, camera.fx,
                      camera.fy, camera.cx, camera.cy));
    const double away = camera.viewmat.topRightCorner<3, 1>().stableNorm();
    if (!(camera.viewmat.allFinite() && away <= farthest))
      throw Error(fmt::format("camera {} of {} is {:g} from the origin, expected at most {:g}",
                              camera.name, place_of(scene), away, farthest));
  }
}

Eigen::Vector3d middle_of_cameras(const Scene& scene) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Frame& frame : scene.train)
    mean += scene.cameras[size_t(frame.camera)].position() / double(scene.train.size());
  return mean;
}

// The point nearest to the optical axes of all training cameras; nullopt if they are nearly
// parallel or there is one camera. Computed relative to the mean camera position, which may be far
// from zero.
std::optional<Eigen::Vector3d> optical_axes_intersection(const Scene& scene) {
  const Eigen::Vector3d middle = middle_of_cameras(scene);
  Eigen::Matrix3d a = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  for (const Frame& frame : scene.train) {
    const Camera& camera = scene.cameras[size_t(frame.camera)];
    const Eigen::Vector3d axis = camera.viewmat.block<1, 3>(2, 0).transpose();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    a += across;
    b += across * (camera.position() - middle);
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(a);
  if (solver.eigenvalues()[0] < 1e-3 * double(scene.train.size())) return std::nullopt;
  return middle + Eigen::Vector3d(a.ldlt().solve(b));
}

// World origin for training: a point near the training cameras if they are so far from zero that
// float rounding (relative error 6e-8) would be visible, else zero. With points: if cameras are
// more than 16 times the scene size from zero, which is an error of 1/1000 px at a focal length of
// 1000 px. Without points the scene size is a guess from where the optical axes meet, which may be
// anywhere for a camera that hardly moves. So zero is kept unless the error reaches a quarter of a
// pixel and coordinates exceed 1e4, as in surveys. Zero is also kept if all cameras are at one
// place: the scene is then assumed to be about zero, as in D-NeRF. The origin is rounded to a
// multiple of the power of ten below the scene size, to be readable.
std::array<double, 3> origin_for(const Scene& scene) {
  const Eigen::Vector3d middle = middle_of_cameras(scene);
  double size = 0;
  for (const Frame& frame : scene.train)
    size = std::max(size, (scene.cameras[size_t(frame.camera)].position() - middle).norm());
  const double away = middle.norm();
  if (scene.points.size() > 0) {
    size = std::max(size, median_distance(scene.points, middle));
    if (away < 16 * size) return {0, 0, 0};
  } else {
    constexpr double least = 1e4, rounding = 1e-9;
    if (const auto place = optical_axes_intersection(scene))
      size = std::max(size, (*place - middle).norm());
    if (away < least || away < 4096 * size || size <= rounding * away) return {0, 0, 0};
  }
  if (!(size > 0)) return {0, 0, 0};
  const double unit = std::pow(10., std::floor(std::log10(size)));
  const Eigen::Vector3d origin = (middle / unit).array().round() * unit;
  return {origin.x(), origin.y(), origin.z()};
}

// Changes coordinates to x' = x - origin for the whole scene.
void recentre(Scene& scene, const std::array<double, 3>& place) {
  scene.origin = place;
  const Eigen::Vector3d origin(place.data());
  if (origin.isZero(0)) return;
  for (Camera& camera : scene.cameras)
    camera.viewmat.topRightCorner<3, 1>() += camera.viewmat.topLeftCorner<3, 3>() * origin;
  for (size_t i = 0; i < scene.points.size(); ++i)
    Eigen::Map<Eigen::Vector3d>(&scene.points.xyz[3 * i]) -= origin;
}

// What the masks of a scene mean.
void set_masks(Scene& scene, const SceneOptions& options) {
  size_t masked = 0, all = 0;
  for (const std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val})
    for (const Frame& frame : *split) masked += !frame.mask_path.empty(), ++all;
  if (masked == 0) {
    const bool told = scene.layout == "colmap" || scene.layout == "nerfstudio";
    if (options.masks != Masks::none && !told && fs::is_directory(scene.folder))
      report_unused_masks(scene.folder,
                          "only COLMAP, nerfstudio and Panoptic scenes have masks; for others put "
                          "them into the alpha channel of the images",
                          scene);
    return;
  }
  // The foreground matters in training only.
  if (masked < all && options.masks != Masks::foreground)
    scene.notices.push_back(
        fmt::format("{} of {} images have a mask; in the others all pixels count", masked, all));
  scene.masks = options.masks == Masks::automatic ? Masks::ignore : options.masks;
  if (options.masks == Masks::automatic)
    scene.notices.push_back(
        "where masks are black, pixels are left out of the training; if black means transparent, "
        "use --set scene.masks=alpha, if it means background, --set scene.masks=foreground");
}

}  // namespace

void complete_scene(Scene& scene, const SceneOptions& options,
                    const std::optional<std::array<double, 3>>& origin) {
  check(options);
  if (scene.train.empty())
    throw Error(fmt::format("{} has no training images: all {} are test images{}", place_of(scene),
                            scene.test.size(),
                            has_trait(scene.layout, kUsesTestEvery) ? " (scene.test_every)" : ""));
  if (options.fps > 0) scene.fps = options.fps;
  if (scene.fps <= 0) scene.fps = 24;
  if (scene.steps == 0) {
    const std::vector<double> times = distinct_times(scene.train);
    for (std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val})
      set_steps(times, *split);
    scene.steps = int(times.size());
  }
  select_steps(scene, options);
  order_frames(scene);
  for (std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val})
    for (Frame& frame : *split)
      if (frame.image && frame.path.empty()) frame.path = "image of " + frame.name;
  check(scene);
  recentre(scene, origin ? *origin : origin_for(scene));
  if (scene.extent <= 0) scene.extent = scene_extent(scene);
  if (scene.near_plane <= 0) scene.near_plane = near_plane_of(scene);
}

Scene read_scene(const std::string& path, const SceneOptions& options,
                 const std::optional<std::array<double, 3>>& origin) {
  if (path.empty())
    throw Error("cannot read the scene: scene.path is empty, expected a scene folder or a video");
  if (!fs::exists(path))
    throw Error(fmt::format("cannot read {}: there is no such scene folder or video", path));
  check(options);
  Scene scene = read_recognised(path, options);
  scene.folder = path;
  set_masks(scene, options);
  find_depth_files(scene);
  const fs::path absolute = fs::absolute(path).lexically_normal();
  const fs::path last = (absolute.has_filename() ? absolute : absolute.parent_path()).filename();
  scene.name = (fs::is_directory(path) ? last : last.stem()).string();
  scene.tracks_path = first_existing(path, {"tracks3d.npy"});
  if (!has_trait(scene.layout, kSkipsCameras)) skip_cameras(scene, options.skip_cameras);
  shift_times(scene, options.time_offsets);
  hold_back(scene, options.val_every);
  complete_scene(scene, options, origin);
  if (scene.points.size() > 0 && scene.points.rgb.empty())
    scene.notices.push_back(fmt::format(
        "the points of {} have no colours (red, green, blue): their Gaussians start grey", path));
  constexpr size_t enough = 100;  // a few points say nothing
  if (const double seen = share_of_points_in_view(scene);
      scene.points.size() >= enough && seen < 0.5)
    scene.notices.push_back(
        fmt::format("only {:.0f} % of the points of {} are in view of a training camera: they may "
                    "use another coordinate system than the cameras",
                    100 * seen, scene.points.source));
  return scene;
}

Eigen::Vector3d focus_point(const Scene& scene) {
  if (const auto place = optical_axes_intersection(scene)) return *place;
  Eigen::Vector3d ahead = Eigen::Vector3d::Zero();
  for (const Frame& frame : scene.train)
    ahead += scene.cameras[size_t(frame.camera)].viewmat.block<1, 3>(2, 0).transpose();
  return middle_of_cameras(scene) + ahead.normalized() * scene.extent;
}

double share_of_points_in_view(const Scene& scene) {
  constexpr size_t most = 20000;
  const size_t stride = std::max<size_t>(1, scene.points.size() / most);
  std::set<int> cameras;
  for (const Frame& frame : scene.train) cameras.insert(frame.camera);
  size_t seen = 0, all = 0;
  for (size_t i = 0; i < scene.points.size(); i += stride, ++all) {
    const Eigen::Map<const Eigen::Vector3d> point(&scene.points.xyz[3 * i]);
    seen += std::any_of(cameras.begin(), cameras.end(), [&](int index) {
      return scene.cameras[size_t(index)].depth_in_view(point).has_value();
    });
  }
  return all == 0 ? 1 : double(seen) / double(all);
}

ImageId image_id(const Frame& frame) {
  return {frame.camera, frame.path, frame.video_frame, frame.mask_path};
}

bool are_training_images(const Scene& scene, const std::vector<Frame>& frames) {
  std::set<ImageId> trained;
  for (const Frame& frame : scene.train) trained.insert(image_id(frame));
  return std::all_of(frames.begin(), frames.end(),
                     [&](const Frame& frame) { return trained.count(image_id(frame)) > 0; });
}

bool takes_cameras(std::string_view layout) { return has_trait(layout, kTakesCameras); }

bool is_z_up(std::string_view layout) { return has_trait(layout, kZIsUp); }

bool is_rig(std::string_view layout) { return has_trait(layout, kIsRig); }

std::string layout_of(const std::string& path) {
  for (const Layout& layout : layouts)
    if (layout.is(path)) return layout.name;
  return "";
}

std::vector<FlowPair> neighbour_pairs(const Scene& scene) {
  // Frames are sorted by track, then time; readers give equal cameras one index.
  std::vector<FlowPair> pairs;
  for (size_t i = 0; i < scene.train.size(); ++i) {
    const Frame& frame = scene.train[i];
    const Frame* next = i + 1 < scene.train.size() ? &scene.train[i + 1] : nullptr;
    const bool has_next = next && next->track == frame.track && next->time > frame.time;
    if (has_next) pairs.push_back({int(i), int(i) + 1});
    if (!frame.flow_path.empty() && !(has_next && next->camera == frame.camera))
      pairs.push_back({int(i), -1});
  }
  return pairs;
}

std::vector<FlowPair> distant_pairs(const Scene& scene, int span) {
  std::vector<FlowPair> pairs;
  for (size_t i = 0; i + size_t(span) < scene.train.size(); ++i) {
    const Frame &frame = scene.train[i], &later = scene.train[i + size_t(span)];
    if (later.track == frame.track && later.time > frame.time)
      pairs.push_back({int(i), int(i) + span, span});
  }
  return pairs;
}

std::vector<FlowPair> pairs_in_time(const Scene& scene) {
  std::map<double, int> by_time;
  for (size_t i = 0; i < scene.train.size(); ++i)
    if (!by_time.emplace(scene.train[i].time, int(i)).second)
      throw Error(fmt::format(
          "flow.pairs is \"time\", which needs one frame per time, but scene '{}' has {} "
          "and another frame at time {}",
          scene.name, scene.train[i].name, scene.train[i].time));
  std::vector<FlowPair> pairs;
  for (auto at = by_time.begin(); at != by_time.end() && std::next(at) != by_time.end(); ++at)
    pairs.push_back({at->second, std::next(at)->second});
  return pairs;
}

bool is_backward_in_time(const Scene& scene, const FlowPair& pair) {
  return pair.next >= 0 &&
         scene.train[size_t(pair.next)].time < scene.train[size_t(pair.frame)].time;
}

std::vector<FlowPair> reversed(const std::vector<FlowPair>& pairs) {
  std::vector<FlowPair> back;
  for (const FlowPair& pair : pairs)
    if (pair.next >= 0) back.push_back({pair.next, pair.frame, pair.span});
  return back;
}

}  // namespace gflow
