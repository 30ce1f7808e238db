// SPDX-License-Identifier: Apache-2.0
// `gflow cameras`: finds the poses of one moving camera. Needs no device.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>

#include "apps/common/command_line.hpp"
#include "apps/common/options.hpp"
#include "apps/common/output_path.hpp"
#include "optim/cameras/find_cameras.hpp"
#include "runtime/base/output.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

struct CamerasFlags {
  SceneOptions scene;
  FindCameras how;
  std::string method = "tracks", output;
};

void require_empty(const std::string& folder) {
  if (fs::exists(folder) && !(fs::is_directory(folder) && fs::is_empty(folder)) &&
      !is_unfinished_scene(folder))
    throw Error(fmt::format("writing a scene to {}: it is not empty; give a new folder", folder));
}

void run_cameras(const CamerasFlags& flags, const GlobalOptions& global) {
  require_no_folder_of_run(flags.output);
  require_empty(flags.output);
  FindCameras how = flags.how;
  how.method = value_named<CameraMethod>(flags.method);
  how.quiet = global.quiet;
  find_cameras(load_video(flags.scene), flags.scene, how, flags.output);
  print_result("next      gflow train {} -o RUN\n", flags.output);
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
  command
      ->add_option("-o,--output", flags->output,
                   "Folder of the scene; new or empty, or of the same command that was stopped")
      ->check(path_given())
      ->required()
      ->type_name("SCENE");
  command
      ->add_option("--method", flags->method,
                   "tracks: follow points through the video; colmap: run the program COLMAP, which "
                   "must be installed (apt install colmap), also for photographs in any order")
      ->check(choice_of({"tracks", "colmap"}));
  command->add_option("-r,--resolution", flags->scene.resolution, "Divisor of the image size")
      ->check(choice_of({"1", "2", "4", "8"}));
  command->add_option("--stride", flags->scene.stride, "Use every n-th frame")
      ->check(number_in(1, 1e6));
  command
      ->add_option("--fovy", flags->how.fovy,
                   "Vertical field of view in degrees; default: estimated from the video")
      ->check(number_in(1, 179));
  command->add_flag("--radial", flags->how.radial, "Estimate radial lens distortion");
  command->callback([flags, &global] { run_cameras(*flags, global); });
}

}  // namespace gflow
