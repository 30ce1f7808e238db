// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/find_cameras.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>

#include "optim/cameras/camera_scene.hpp"
#include "optim/cameras/colmap.hpp"
#include "optim/cameras/reconstruction.hpp"
#include "optim/cameras/two_views.hpp"
#include "optim/cameras/upright.hpp"
#include "optim/scene/readers/given_cameras.hpp"
#include "runtime/base/interrupt.hpp"
#include "runtime/base/output.hpp"
#include "runtime/base/progress.hpp"
#include "runtime/base/unfinished_file.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

constexpr size_t kLeastFrames = 3;

std::vector<FeatureTrack> follow(const std::vector<Frame>& frames, FrameStore& store, bool quiet) {
  FeatureTracker tracker;
  Progress progress("tracks", long(frames.size()), quiet);
  for (const Frame& frame : frames) {
    tracker.add(store.rgb(frame));
    progress.advance();
  }
  return tracker.finish();
}

// "3", "5 to 9": the frames without a pose.
std::vector<std::string> gaps_of(const CameraPath& path) {
  std::vector<std::string> gaps;
  for (size_t k = 0, end = 0; k < path.poses.size(); k = std::max(k + 1, end)) {
    if (path.poses[k]) continue;
    for (end = k; end < path.poses.size() && !path.poses[end];) ++end;
    gaps.push_back(end == k + 1 ? fmt::format("{}", k) : fmt::format("{} to {}", k, end - 1));
  }
  return gaps;
}

// breaks: frames before which nearly all tracks end.
void warn_of_gaps(const CameraPath& path, const std::vector<int>& breaks) {
  const std::vector<std::string> gaps = gaps_of(path);
  if (gaps.empty()) return;
  std::string why;
  for (const int frame : breaks)
    why += fmt::format("; nearly all points are lost between frames {} and {}", frame - 1, frame);
  print_status("gflow: warning: frames {} could not be placed and are left out{}\n",
               fmt::join(gaps, ", "), why);
}

// The finished scene takes its name at once.
void write_scene(const std::string& folder, const std::function<void(const std::string&)>& write) {
  const std::string unfinished = folder + ".unfinished";
  const UnfinishedFile noted(unfinished);
  fs::remove_all(unfinished);
  try {
    write(unfinished);
    if (fs::path(folder).has_parent_path()) fs::create_directories(fs::path(folder).parent_path());
    fs::remove_all(folder);
    fs::rename(unfinished, folder);
  } catch (...) {
    std::error_code problem;
    fs::remove_all(unfinished, problem);
    throw;
  }
}

double focal_of(const FindCameras& how, const Camera& size) {
  return how.fovy > 0 ? 0.5 * size.height / std::tan(0.5 * how.fovy * degree) : 0;
}

TrackedPath find_by_tracks(const LoadedScene& video, const FindCameras& how) {
  const std::vector<Frame>& frames = video.scene.train;
  const Camera& size = video.frames->camera(frames[0]);
  TrackedPath found;
  found.tracks = follow(frames, *video.frames, how.quiet);
  ReconstructionOptions options;
  options.frames = int(frames.size());
  options.width = size.width;
  options.height = size.height;
  options.radial = how.radial;
  options.focal = focal_of(how, size);
  Progress placing("cameras", options.frames, how.quiet);
  options.progress = progress_callback(placing);
  found.path = reconstruct(found.tracks, options);
  placing.finish();
  return found;
}

ColmapResult find_by_colmap(const LoadedScene& video, const FindCameras& how,
                            const std::string& folder) {
  ColmapOptions options;
  options.focal = focal_of(how, video.frames->camera(video.scene.train[0]));
  options.radial = how.radial;
  options.quiet = how.quiet;
  options.kept_log = folder + ".colmap.log";
  return reconstruct_with_colmap(video, options);
}

void report(const std::string& folder, const std::vector<FeatureTrack>& tracks,
            const CameraPath& path, int height) {
  const ReprojectionStatistics s = statistics_of(tracks, path);
  const auto placed = std::count_if(path.poses.begin(), path.poses.end(),
                                    [](const auto& pose) { return pose.has_value(); });
  print_result("frames    {} of {} placed\n", placed, path.poses.size());
  print_result("focal     {:.1f} px, vertical field of view {:.1f} degrees\n", path.lens.focal,
               2 * std::atan(0.5 * height / path.lens.focal) / degree);
  if (path.lens.k1 != 0) print_result("radial    k1 {:.4f}\n", path.lens.k1);
  print_result("points    {} seen {} times, reprojection error {:.2f} px median, {:.2f} mean\n",
               s.points, s.observations, s.median, s.mean);
  print_result("written   {}\n", folder);
}

}  // namespace

LoadedScene load_video(const SceneOptions& options) {
  if (const std::string layout = layout_of(options.path); !takes_cameras(layout) && !layout.empty())
    throw Error(
        fmt::format("finding the cameras of {}: it is a scene that has cameras ({}); give "
                    "a video or a folder of numbered images",
                    options.path, layout));
  Scene scene = read_scene(options.path, options);
  for (const std::string& notice : scene.notices)
    if (notice != kNoPoses) warn(notice);
  scene.notices.clear();
  return with_frames(std::move(scene), options, "");
}

std::string made_from(const Scene& video, const SceneOptions& options) {
  return fmt::format("{}\n{}", fs::absolute(video.folder).lexically_normal().string(),
                     cache_stamp(video, options));
}

void find_cameras(const LoadedScene& video, const SceneOptions& options, const FindCameras& how,
                  const std::string& folder) {
  const std::vector<Frame>& frames = video.scene.train;
  if (frames.size() < kLeastFrames)
    throw Error(fmt::format("finding the cameras of {}: it has {} frame{}, at least {} are needed",
                            video.scene.folder, frames.size(), frames.size() == 1 ? "" : "s",
                            kLeastFrames));
  const bool by_colmap = how.method == CameraMethod::colmap;
  TrackedPath found;
  std::string log;
  try {
    if (by_colmap) {
      ColmapResult result = find_by_colmap(video, how, folder);
      found = std::move(result.found);
      log = std::move(result.log);
    } else {
      found = find_by_tracks(video, how);
    }
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& problem) {
    throw Error(fmt::format("finding the cameras of {}: {}", video.scene.folder, problem.what()));
  }
  const std::vector<FeatureTrack>& tracks = found.tracks;
  CameraPath& path = found.path;
  make_upright(tracks, path);
  // COLMAP's tracks also span frames that do not show them, so that they reveal no breaks.
  warn_of_gaps(path, by_colmap ? std::vector<int>{} : breaks_of(tracks, int(frames.size())));
  write_scene(folder, [&](const std::string& unfinished) {
    Progress writing("images", long(frames.size()), how.quiet);
    write_camera_scene(unfinished, video, tracks, path, progress_callback(writing));
    write_file_atomically(unfinished + "/" + kMadeFrom, made_from(video.scene, options));
    if (by_colmap) write_file_atomically(unfinished + "/colmap.log", log);
  });
  report(folder, tracks, path, video.frames->camera(frames[0]).height);
}

}  // namespace gflow
