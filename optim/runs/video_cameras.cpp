// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/video_cameras.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "optim/cameras/camera_moves.hpp"
#include "optim/runs/run_names.hpp"
#include "runtime/base/interrupt.hpp"
#include "runtime/base/output.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

std::string text_of(const std::string& path) {
  if (!fs::exists(path)) return "";
  const Bytes bytes = read_file(path);
  return {bytes.begin(), bytes.end()};
}

// The scene holds what the settings have chosen of the video, in that size.
SceneOptions of_found_scene(const SceneOptions& video, const std::string& folder) {
  SceneOptions scene;
  scene.path = folder;
  scene.background = video.background;
  scene.test_every = video.test_every;
  scene.val_every = video.val_every;
  return scene;
}

}  // namespace

void find_cameras_of_video(TrainOptions& config, const RunFolder& run,
                           std::optional<CameraMethod> method, bool resumes, bool quiet) {
  const SceneOptions& options = config.scene;
  const auto leave_alone = [&](const std::string& why) {
    if (method)
      throw Error(fmt::format(
          "--method {}: {} {}, so its cameras are not searched for; the option is for a video, or "
          "numbered images, of one camera that moves",
          name_of(*method), options.path, why));
  };
  if (options.still) return leave_alone("has a camera that stands still (--still)");
  if (!options.cameras.empty()) return leave_alone("has given cameras (--cameras)");
  const std::string layout = layout_of(options.path);
  if (!takes_cameras(layout))
    return leave_alone(layout.empty() ? "is no video"
                                      : fmt::format("has its own cameras ({})", layout));
  const std::string folder = fs::absolute(run.path(kRunScene)).lexically_normal().string();
  const std::string before = text_of(folder + "/" + kMadeFrom);
  if (resumes && before.substr(0, before.find('\n')) == options.path) {
    config.scene.path = folder;
    return;
  }
  SceneOptions of_all = options;  // the poses of frames that are held back are needed, too
  of_all.val_every = 0;
  const LoadedScene video = load_video(of_all);
  if (video.scene.has_alpha) return leave_alone("has transparent images");
  if (!are_training_images(video.scene, video.scene.test))
    return leave_alone("has test images of other cameras");
  FindCameras how;
  how.method = method.value_or(CameraMethod::tracks);
  how.quiet = quiet;
  const std::string expected = made_from(video.scene, options, how.method);
  const bool is_made = method ? before == expected : before.rfind(expected, 0) == 0;
  if (!is_made) {
    if (!method && !camera_moves(video.scene.train, *video.frames)) return;
    if (!quiet && !method)
      print_status("the camera moves: its poses are found first (--still takes it for static)\n");
    if (before.empty() && fs::exists(folder) && !is_unfinished_scene(folder))
      throw Error(fmt::format(
          "training {}: its poses would be written to {}, which gflow did not make; name another "
          "run folder",
          options.path, folder));
    try {
      find_cameras(video, options, how, folder);
    } catch (const Interrupted&) {
      throw;
    } catch (const Error& problem) {
      throw Error(
          fmt::format("{}; --still trains it as the video of a static camera, --cameras FILE with "
                      "poses from elsewhere",
                      problem.what()));
    }
  }
  config.scene = of_found_scene(options, folder);
}

}  // namespace gflow
