// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/find_cameras.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>

#include "optim/cameras/camera_scene.hpp"
#include "optim/cameras/colmap.hpp"
#include "optim/cameras/motion_mask_files.hpp"
#include "optim/cameras/reconstruction.hpp"
#include "optim/cameras/track_file.hpp"
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

// The folder of a scene to be written, with the tracks of a search that has not ended. An error
// removes what the search has made; if the program is stopped, the next search continues.
class UnfinishedSearch {
 public:
  UnfinishedSearch(const std::string& folder, std::string stamp)
      : file_(folder + "/" + kTrackFile), stamp_(std::move(stamp)) {
    for (fs::path at = folder; !at.empty() && !fs::exists(at); at = at.parent_path())
      made_.push_back(at);
  }

  std::optional<TrackingState> tracks() const { return read_tracks(file_, stamp_); }
  void keep(const TrackingState& state) {
    if (!made_.empty()) fs::create_directories(made_[0]);
    write_tracks(file_, stamp_, state);
    if (!stop_)
      stop_.emplace("interrupted while finding cameras; the same command continues from " + file_);
  }
  void give_up() {
    std::error_code none;
    fs::remove(file_, none);
    for (const fs::path& folder : made_) fs::remove(folder, none);  // those that are empty
  }

 private:
  std::string file_, stamp_;
  std::vector<fs::path> made_;  // folders that did not exist, innermost first
  std::optional<StopSentence> stop_;
};

std::vector<FeatureTrack> follow(const std::vector<Frame>& frames, FrameStore& store, bool quiet,
                                 UnfinishedSearch& search) {
  using Clock = std::chrono::steady_clock;
  constexpr std::chrono::seconds kBetween(10);  // two times at which the tracks are kept
  TrackingState begun = search.tracks().value_or(TrackingState());
  const size_t first = size_t(begun.frames);
  if (first > 0 && !quiet)
    print_status("continuing from the tracks of {} of {} frames\n", first, frames.size());
  std::vector<std::shared_ptr<const Image>> recent;
  for (size_t k = first - std::min<size_t>(first, FeatureTracker::kKept); k < first; ++k)
    recent.push_back(store.rgb(frames[k]));
  FeatureTracker tracker(std::move(begun), recent);
  Progress progress("tracks", long(frames.size()), quiet, long(first));
  Clock::time_point kept = Clock::now();
  for (size_t k = first; k < frames.size(); ++k) {
    tracker.add(store.rgb(frames[k]));
    progress.advance();
    if (Clock::now() - kept < kBetween && k + 1 < frames.size()) continue;
    search.keep(tracker.state());
    kept = Clock::now();
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
    why += fmt::format(
        "; nearly all points are lost between frames {} and {}, as at a cut: scenes of a video are "
        "found one by one, from parts of it",
        frame - 1, frame);
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

TrackedPath find_by_tracks(const LoadedScene& video, const FindCameras& how,
                           UnfinishedSearch& search) {
  const std::vector<Frame>& frames = video.scene.train;
  const Camera& size = video.frames->camera(frames[0]);
  TrackedPath found;
  found.tracks = follow(frames, *video.frames, how.quiet, search);
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

// Whether a focal length a tenth longer or shorter explains the tracks clearly worse. A camera that
// moves to the side without turning leaves that open: all depths may be longer as well.
bool focal_is_certain(const std::vector<FeatureTrack>& tracks, const CameraPath& path) {
  constexpr double clearly = 1.05;  // of the mean robust error
  const auto error_at = [&](double factor) {
    CameraPath other = path;
    other.lens.focal *= factor;
    BundleOptions how;
    how.refine_focal = false;
    how.iterations = 10;
    return adjust_bundle(tracks, how, other);
  };
  const double error = error_at(1);
  return std::min(error_at(1.1), error_at(1 / 1.1)) > clearly * error;
}

// What was found, in words and as statistics.json of the scene.
struct Findings {
  size_t frames = 0, placed = 0;
  std::vector<std::string> left_out;
  SharedLens lens;
  double fovy = 0;  // [degrees]
  bool focal_is_certain = true;
  ReprojectionStatistics reprojection;
  std::optional<double> moving;  // share of pixels in motion masks; nullopt: there are none
};

Findings findings_of(const std::vector<FeatureTrack>& tracks, const CameraPath& path, int height,
                     bool focal_is_given) {
  Findings f;
  f.frames = path.poses.size();
  f.placed = size_t(std::count_if(path.poses.begin(), path.poses.end(),
                                  [](const auto& pose) { return pose.has_value(); }));
  f.left_out = gaps_of(path);
  f.lens = path.lens;
  f.fovy = 2 * std::atan(0.5 * height / path.lens.focal) / degree;
  f.focal_is_certain = focal_is_given || focal_is_certain(tracks, path);
  f.reprojection = statistics_of(tracks, path);
  return f;
}

std::string statistics_json(const Findings& f) {
  nlohmann::ordered_json json{{"frames", f.frames},
                              {"placed", f.placed},
                              {"left_out", f.left_out},
                              {"focal", f.lens.focal},
                              {"fovy", f.fovy},
                              {"focal_is_certain", f.focal_is_certain},
                              {"k1", f.lens.k1},
                              {"points", f.reprojection.points},
                              {"observations", f.reprojection.observations},
                              {"reprojection_median", f.reprojection.median},
                              {"reprojection_mean", f.reprojection.mean}};
  if (f.moving) json["moving"] = *f.moving;
  return json.dump(1) + "\n";
}

void report(const std::string& folder, const Findings& f) {
  print_result("frames    {} of {} placed\n", f.placed, f.frames);
  print_result("focal     {:.1f} px, vertical field of view {:.1f} degrees\n", f.lens.focal,
               f.fovy);
  if (f.lens.k1 != 0) print_result("radial    k1 {:.4f}\n", f.lens.k1);
  print_result("points    {} seen {} times, reprojection error {:.2f} px median, {:.2f} mean\n",
               f.reprojection.points, f.reprojection.observations, f.reprojection.median,
               f.reprojection.mean);
  if (f.moving)
    print_result("moving    {:.1f} % of the images\n", 100 * *f.moving);
  else
    print_result("moving    no masks, which --method tracks writes\n");
  print_result("written   {}\n", folder);
  if (!f.focal_is_certain)
    print_status(
        "gflow: warning: the camera turns too little for its focal length to be certain: one a "
        "tenth longer or shorter agrees with the images as well, and depths change with it; give "
        "--fovy if it is known\n");
}

// Small images show little.
std::string with_resolution(const std::string& problem, const SceneOptions& options) {
  return options.resolution > 1
             ? fmt::format("{}; the images are reduced by -r {}: use a smaller one", problem,
                           options.resolution)
             : problem;
}

// Error if hardly any frames belong together: they would train a scene of nothing.
void require_scene(const Findings& findings) {
  constexpr size_t least_points = 20, least_share = 10;  // one in so many frames
  if (findings.reprojection.points >= least_points &&
      findings.placed * least_share >= findings.frames)
    return;
  throw Error(
      fmt::format("only {} of {} frames could be placed, with {} point{} in common: the images "
                  "have too little texture, too much blur or no order",
                  findings.placed, findings.frames, findings.reprojection.points,
                  findings.reprojection.points == 1 ? "" : "s"));
}

}  // namespace

LoadedScene load_video(const SceneOptions& options) {
  const std::string layout = layout_of(options.path);
  if (layout.empty() && fs::is_directory(options.path))
    throw Error(
        fmt::format("finding the cameras of {}: the folder has no numbered images; give a video, "
                    "or a folder of images such as 0001.png, 0002.png, 0003.png",
                    options.path));
  if (!takes_cameras(layout) && !layout.empty())
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

std::string made_from(const Scene& video, const SceneOptions& options, CameraMethod method) {
  return fmt::format("{}\n{}{}", fs::absolute(video.folder).lexically_normal().string(),
                     cache_stamp(video, options),
                     method == CameraMethod::tracks ? "" : fmt::format("by {}\n", name_of(method)));
}

bool is_unfinished_scene(const std::string& folder) {
  std::error_code none;
  const auto files = std::distance(fs::directory_iterator(folder, none), {});
  return files == 1 && fs::exists(folder + "/" + kTrackFile);
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
  Findings findings;
  std::string log;
  UnfinishedSearch search(folder, cache_stamp(video.scene, options));
  try {
    if (by_colmap) {
      ColmapResult result = find_by_colmap(video, how, folder);
      found = std::move(result.found);
      log = std::move(result.log);
    } else {
      found = find_by_tracks(video, how, search);
    }
    make_upright(found.tracks, found.path);
    findings =
        findings_of(found.tracks, found.path, video.frames->camera(frames[0]).height, how.fovy > 0);
    require_scene(findings);
  } catch (const Interrupted&) {
    throw;
  } catch (const Error& problem) {
    search.give_up();
    throw Error(fmt::format("finding the cameras of {}: {}", video.scene.folder,
                            with_resolution(problem.what(), options)));
  }
  const std::vector<FeatureTrack>& tracks = found.tracks;
  const CameraPath& path = found.path;
  // COLMAP's tracks also span frames that do not show them, so that they reveal no breaks.
  warn_of_gaps(path, by_colmap ? std::vector<int>{} : breaks_of(tracks, int(frames.size())));
  write_scene(folder, [&](const std::string& unfinished) {
    Progress writing("images", long(frames.size()), how.quiet);
    write_camera_scene(unfinished, video, tracks, path, progress_callback(writing));
    writing.finish();
    if (!by_colmap) {  // photographs in any order have no flow
      Progress comparing("masks", long(findings.placed), how.quiet);
      findings.moving = write_motion_mask_files(unfinished + "/" + kMotionMasks, video, path,
                                                progress_callback(comparing));
    }
    write_file_atomically(unfinished + "/" + kMadeFrom,
                          made_from(video.scene, options, how.method));
    write_file_atomically(unfinished + "/statistics.json", statistics_json(findings));
    if (by_colmap) write_file_atomically(unfinished + "/colmap.log", log);
  });
  report(folder, findings);
}

}  // namespace gflow
