// SPDX-License-Identifier: Apache-2.0
// `gflow cameras`: finds the poses of one moving camera. Needs no device.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <functional>
#include <memory>

#include "apps/common/command_line.hpp"
#include "apps/common/options.hpp"
#include "apps/common/output_path.hpp"
#include "optim/cameras/camera_scene.hpp"
#include "optim/cameras/reconstruction.hpp"
#include "optim/cameras/two_views.hpp"
#include "optim/cameras/upright.hpp"
#include "optim/scene/loaded_scene.hpp"
#include "optim/scene/readers/given_cameras.hpp"
#include "runtime/base/output.hpp"
#include "runtime/base/progress.hpp"
#include "runtime/base/warning.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

constexpr size_t kLeastFrames = 3;

struct CamerasFlags {
  SceneOptions scene;
  std::string output;
  double fovy = 0;  // [degrees]; 0: estimated
  bool radial = false;
};

// Error if it has cameras.
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

void warn_of_gaps(const std::vector<FeatureTrack>& tracks, const CameraPath& path) {
  const std::vector<std::string> gaps = gaps_of(path);
  if (gaps.empty()) return;
  std::string why;
  for (const int frame : breaks_of(tracks, int(path.poses.size())))
    why += fmt::format("; nearly all points are lost between frames {} and {}", frame - 1, frame);
  print_status("gflow: warning: frames {} could not be placed and are left out{}\n",
               fmt::join(gaps, ", "), why);
}

// The finished scene takes its name at once.
void write_scene(const std::string& folder, const std::function<void(const std::string&)>& write) {
  const std::string unfinished = folder + ".unfinished";
  fs::remove_all(unfinished);
  write(unfinished);
  fs::remove(folder);  // it is empty
  fs::rename(unfinished, folder);
}

void require_empty(const std::string& folder) {
  if (fs::exists(folder) && !(fs::is_directory(folder) && fs::is_empty(folder)))
    throw Error(fmt::format("writing a scene to {}: it is not empty; give a new folder", folder));
}

ReconstructionOptions options_of(const CamerasFlags& flags, const Camera& size, size_t frames) {
  ReconstructionOptions options;
  options.frames = int(frames);
  options.width = size.width;
  options.height = size.height;
  options.radial = flags.radial;
  if (flags.fovy > 0) options.focal = 0.5 * size.height / std::tan(0.5 * flags.fovy * degree);
  return options;
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

void run_cameras(const CamerasFlags& flags, const GlobalOptions& global) {
  require_no_folder_of_run(flags.output);
  require_empty(flags.output);
  const LoadedScene loaded = load_video(flags.scene);
  const std::vector<Frame>& frames = loaded.scene.train;
  if (frames.size() < kLeastFrames)
    throw Error(fmt::format("finding the cameras of {}: it has {} frame{}, at least {} are needed",
                            flags.scene.path, frames.size(), frames.size() == 1 ? "" : "s",
                            kLeastFrames));
  const std::vector<FeatureTrack> tracks = follow(frames, *loaded.frames, global.quiet);
  const Camera& size = loaded.frames->camera(frames[0]);
  ReconstructionOptions options = options_of(flags, size, frames.size());
  Progress placing("cameras", options.frames, global.quiet);
  options.progress = progress_callback(placing);
  CameraPath path;
  try {
    path = reconstruct(tracks, options);
  } catch (const Error& problem) {
    throw Error(fmt::format("finding the cameras of {}: {}", flags.scene.path, problem.what()));
  }
  placing.finish();
  make_upright(tracks, path);
  warn_of_gaps(tracks, path);
  write_scene(flags.output, [&](const std::string& folder) {
    Progress writing("images", options.frames, global.quiet);
    write_camera_scene(folder, frames, *loaded.frames, tracks, path, progress_callback(writing));
  });
  report(flags.output, tracks, path, size.height);
}

}  // namespace

void add_cameras(CLI::App& app, const GlobalOptions& global) {
  auto flags = std::make_shared<CamerasFlags>();
  CLI::App* command = app.add_subcommand(
      "cameras", "Find the poses of a moving camera and write its video as a scene");
  command->add_option("VIDEO", flags->scene.path, "Video, or folder of numbered images")
      ->check(path_given())
      ->required()
      ->type_name("PATH");
  command->add_option("-o,--output", flags->output, "Folder of the scene; new or empty")
      ->check(path_given())
      ->required()
      ->type_name("SCENE");
  command->add_option("-r,--resolution", flags->scene.resolution, "Divisor of the image size")
      ->check(choice_of({"1", "2", "4", "8"}));
  command->add_option("--stride", flags->scene.stride, "Use every n-th frame")
      ->check(number_in(1, 1e6));
  command
      ->add_option("--fovy", flags->fovy,
                   "Vertical field of view in degrees; default: estimated from the video")
      ->check(number_in(1, 179));
  command->add_flag("--radial", flags->radial, "Estimate radial lens distortion");
  command->callback([flags, &global] { run_cameras(*flags, global); });
}

}  // namespace gflow
