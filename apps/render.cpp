// SPDX-License-Identifier: Apache-2.0
// `gflow render`: images and videos of a trained model. Views come from the first of: the scene
// (--scene, or that of the run), cameras.json beside or above the model, an orbit.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>

#include "apps/common/command_line.hpp"
#include "apps/common/found_above.hpp"
#include "apps/common/model_source.hpp"
#include "apps/common/options.hpp"
#include "apps/common/output_path.hpp"
#include "optim/eval/rendering.hpp"
#include "optim/images/movie.hpp"
#include "optim/objectives/camera_objective.hpp"
#include "optim/runs/run_state.hpp"
#include "optim/scene/cameras_json.hpp"
#include "runtime/base/interrupt.hpp"
#include "runtime/base/output.hpp"
#include "runtime/base/progress.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/file_lock.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

constexpr double kSwaySeconds = 4;  // of a circle of --sway

struct RenderFlags {
  std::string model, output, split, camera, times, scene, background, up = "-y";
  int resolution = 0, iteration = latest_iteration;
  double fps = 0, sway = 0;
  Undrawable undrawable = Undrawable::left_out;
  bool no_compare = false;
};

// The model, the facts of its run, and the scene if there is one.
struct Source : ModelSource {
  std::optional<LoadedScene> loaded;
};

Source find_source(const RenderFlags& flags) {
  Source source{model_source(flags.model, flags.iteration, flags.undrawable), {}};
  const std::string config = found_above(source.path, "config.toml");
  if (!source.run && !config.empty()) {
    source.run = RunFolder::open(fs::path(config).parent_path().string());
    source.config = source.run->read_config();
  }
  const int own_resolution = source.config.scene.resolution;
  if (flags.background == "white") source.config.scene.background = Background::white;
  if (flags.background == "black") source.config.scene.background = Background::black;
  if (flags.resolution > 0) source.config.scene.resolution = flags.resolution;

  std::string& path = source.config.scene.path;
  if (!flags.scene.empty()) path = flags.scene;
  const bool wanted = !flags.scene.empty() || !flags.split.empty();
  if (path.empty() && wanted)
    throw Error(fmt::format("--split {}: {} has no scene; give one with --scene", flags.split,
                            flags.model));
  if (wanted || (!path.empty() && fs::exists(path))) {
    // Reuses the video frames that training unpacked.
    const bool unpacked = source.run && source.config.scene.resolution == own_resolution;
    source.loaded = load_scene(source.config.scene, unpacked ? source.run->path("frames") : "",
                               source.model.shape.origin);
    if (source.run && flags.scene.empty() &&
        refines_cameras(source.config.cameras, source.loaded->scene))
      source.run->move_cameras(*source.loaded->frames);
  }
  return source;
}

std::vector<double> times_wanted(const RenderFlags& flags, const Scene* scene, bool still) {
  if (flags.times == "all" && !scene)
    throw Error("--times all selects the time steps of a scene; give one with --scene");
  if (scene && (flags.times.empty() || flags.times == "all")) return step_times(*scene);
  if (flags.times.empty()) return parse_times(still ? "0" : "0:1:40");
  return parse_times(flags.times);
}

std::vector<Camera> cameras_wanted(const RenderFlags& flags, const std::vector<Camera>& cameras) {
  if (flags.camera.empty()) return cameras;
  return {camera_named(cameras, flags.camera)};
}

// The cameras of a split, each once.
std::vector<Camera> cameras_of(const std::vector<Frame>& frames,
                               const std::vector<Camera>& cameras) {
  std::vector<Camera> used;
  std::set<int> seen;  // a moving camera may return to a pose
  for (const Frame& frame : frames)
    if (seen.insert(frame.camera).second) used.push_back(cameras[size_t(frame.camera)]);
  return used;
}

std::vector<RenderView> views_wanted(const RenderFlags& flags, const Source& source) {
  const bool still = is_static_model(source.model);
  if (source.loaded) {
    const Scene& scene = source.loaded->scene;
    const std::vector<Camera>& cameras = source.loaded->frames->cameras();
    if (!flags.camera.empty())
      return camera_views(cameras_wanted(flags, cameras), times_wanted(flags, &scene, still),
                          &scene);
    const std::string usual = flags.sway > 0 ? "train" : "test";
    const std::string split = flags.split.empty() ? usual : flags.split;
    const std::vector<Frame>& frames = frames_of_split(scene, split);
    if (flags.times.empty()) return split_views(scene, frames, cameras, split);
    return camera_views(cameras_of(frames, cameras), times_wanted(flags, &scene, still), &scene);
  }
  const std::string json = found_above(source.path, "cameras.json");
  if (!json.empty())
    return camera_views(
        cameras_wanted(flags, read_cameras_json(json, source.config.scene.resolution)),
        times_wanted(flags, nullptr, still), nullptr);
  if (!flags.camera.empty())
    throw Error(fmt::format(
        "--camera {}: there is no cameras.json beside {} and no scene; give one with --scene",
        flags.camera, source.path));
  const std::string times = flags.times.empty() ? "0:1:40" : flags.times;
  if (source.model.count == 0)
    throw Error(fmt::format(
        "rendering {}: it contains no Gaussians, and there is no cameras.json beside it",
        source.path));
  return orbit_views(source.model, parse_times(times), flags.up);
}

// The near plane: of the settings, the scene or cameras.json; 0 if none says it.
double near_of(const Source& source, const std::vector<RenderView>& views) {
  const float set = source.config.render.near;
  if (source.loaded) return double(near_or_default(set, source.loaded->scene));
  return set > 0 || views.empty() ? double(set) : views[0].camera.near;
}

double fps_of(const RenderFlags& flags, const Source& source) {
  if (flags.fps > 0) return flags.fps;
  return source.loaded ? source.loaded->scene.fps : RenderOptions().fps;
}

// views: the rendered views; still: whether the model is static.
void print_written(const RenderReport& report, const std::vector<RenderView>& views, bool still,
                   const std::string& folder) {
  const bool one_time = std::all_of(views.begin(), views.end(), [&](const RenderView& view) {
    return view.time == views[0].time;
  });
  print_result("images    {} views in {}/rgb, alpha, depth\n", report.views, folder);
  if (report.flows)
    print_result("flow      {} views in {}/flow\n", report.flows, folder);
  else if (still)
    print_result("flow      none: the model is static\n");
  else if (one_time)
    print_result("flow      none: no time step of a scene follows the single time {}\n",
                 views[0].time);
  if (report.compared)
    print_result("compared  {} views in {}/compare: truth, render, error x 4{}\n", report.compared,
                 folder, report.flows ? ", flow, reference flow" : "");
  for (const std::string& movie : report.movies) print_result("video     {}\n", movie);
  if (report.movies.empty())
    print_result("video     none: it needs at least two images of equal size{}\n",
                 one_time ? ", so more than one time in --times" : "");
}

// Stems of the files in a folder, without temporaries that a killed process left.
std::set<std::string> stems_in(const fs::path& folder) {
  std::set<std::string> stems;
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(folder, none))
    if (!is_temporary_name(entry.path().filename().string()))
      stems.insert(entry.path().stem().string());
  return stems;
}

// Whether `gflow render` has filled the folder or was interrupted while it started: either one view
// is complete, or the folder contains only the files of the first view.
bool is_of_render(const fs::path& folder) {
  for (const std::string& view : stems_in(folder / "rgb"))
    if (fs::exists(folder / "rgb" / (view + ".png")) &&
        fs::exists(folder / "alpha" / (view + ".png")) &&
        fs::exists(folder / "depth" / (view + ".npy")))
      return true;
  std::set<std::string> begun;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    const bool first = name == "rgb" || name == "alpha" || name == "depth";
    if (!first || !entry.is_directory()) return false;
    begun.merge(stems_in(entry.path()));
  }
  return begun.size() <= 1;
}

// An existing image or video may have the name of a rendered one.
void require_no_other_files(const std::string& folder) {
  if (fs::is_directory(folder) && !is_of_render(folder))
    throw Error(
        fmt::format("rendering into {}: it is not empty and not the output of an earlier gflow "
                    "render; choose a new folder or such an output",
                    folder));
}

// The same for a scene folder, which may contain folders of these names.
void require_no_scene(const std::string& folder) {
  const std::string layout = fs::is_directory(folder) ? layout_of(folder) : "";
  if (!layout.empty())
    throw Error(fmt::format("rendering into {}: it contains a scene ({}); choose another folder",
                            folder, layout));
}

void run_render(const RenderFlags& flags, const GlobalOptions& options) {
  if (!flags.split.empty() && !flags.camera.empty())
    throw Error(
        "--split and --camera exclude each other: --camera renders one camera at all its times");
  require_no_folder_of_run(flags.output);
  require_no_scene(flags.output);
  require_no_other_files(flags.output);
  const Source source = find_source(flags);
  std::vector<RenderView> views = views_wanted(flags, source);
  const double fps = fps_of(flags, source);
  if (flags.sway > 0) views = swaying_views(views, source.model, flags.sway, kSwaySeconds * fps);
  const bool still = is_static_model(source.model);
  if (still)
    for (RenderView& view : views) view.time_t2 = -1;

  RenderOptions render;
  render.settings = engine_settings(source.config);
  const float level = float(shown_level(source.config.scene.background)) / 255;
  render.background = {level, level, level};
  if (const double near = near_of(source, views); near > 0) render.near = float(near);
  render.fps = fps;
  render.compare = !flags.no_compare;

  Queue queue = open_queue(options);
  Model model(queue, source.model, Purpose::rendering);
  std::error_code problem;
  fs::create_directories(flags.output, problem);
  if (problem)
    throw Error(fmt::format("cannot create the folder {}: {}", flags.output, problem.message()));
  const FolderLock lock(flags.output);
  InterruptGuard guard;
  Progress progress("render", long(views.size()), options.quiet);
  const RenderReport report = render_views(
      queue, model, views, source.loaded ? source.loaded->frames.get() : nullptr, flags.output,
      render, [&](size_t done, size_t total) {
        progress.update(long(done));
        if (interrupted())
          throw Interrupted(fmt::format("interrupted after {} of {} views, which are in {}", done,
                                        total, flags.output));
      });
  progress.finish();
  print_state(source.state);
  print_written(report, views, still, flags.output);
}

}  // namespace

void add_render(CLI::App& app, const GlobalOptions& options) {
  auto flags = std::make_shared<RenderFlags>();
  CLI::App* command = app.add_subcommand("render",
                                         "Render a trained model: colour, alpha, depth, flow, "
                                         "comparison with the ground truth, and videos");
  command->add_option("RUN|FILE", flags->model, "Run folder of `gflow train`, or any splat file")
      ->check(path_given())
      ->required()
      ->type_name("PATH");
  command->add_option("-o,--output", flags->output, "Output folder")
      ->check(path_given())
      ->required()
      ->type_name("FOLDER");
  command
      ->add_option("--split", flags->split,
                   "Views: test, train or val; default: test, if there is a scene and no --camera")
      ->check(choice_of({"test", "train", "val"}));
  command
      ->add_option(
          "--camera", flags->camera,
          "One camera of the scene, by name, at --times; empty: those of the split, else all")
      ->type_name("NAME");
  command
      ->add_option("--times", flags->times,
                   "0:1:40 (40 times from 0 to 1), a list 0,0.5,1, or all time steps of the scene; "
                   "empty: the views of the split, all time steps of a camera, else 0:1:40. Flow "
                   "is to the next time; for a single time, to the scene's next time step")
      ->type_name("TIMES");
  command
      ->add_option("--sway", flags->sway,
                   "Circle around each pose of the camera, so many degrees to each side, once in "
                   "four seconds or in a shorter video: shows depth; training views unless --split "
                   "or --camera says otherwise")
      ->check(zero_or_in(0.1, 45))
      ->type_name("DEGREES");
  command
      ->add_option(
          "--scene", flags->scene,
          "Scene folder, for a splat file without a run or a moved scene; empty: as in the run")
      ->type_name("FOLDER");
  command
      ->add_option("-r,--resolution", flags->resolution,
                   "Divisor of width and height: 1, 2, 4 or 8; 0: as in the run, else 1")
      ->check(choice_of({"0", "1", "2", "4", "8"}));
  command->add_option("--background", flags->background, "white or black; empty: as in the run")
      ->check(choice_of({"white", "black"}));
  command
      ->add_option("--fps", flags->fps,
                   "Frames per second of the videos; 0: as in the scene, else 24")
      ->check(zero_or_in(slowest_fps, fastest_fps));
  command
      ->add_option("--up", flags->up,
                   "Up axis of the orbit that is rendered without cameras: x, y, z, -x, -y or -z, "
                   "e.g. --up=-y")
      ->check(choice_of({"x", "y", "z", "-x", "-y", "-z"}))
      ->type_name("AXIS");
  add_iteration(*command, flags->iteration);
  add_strict(*command, flags->undrawable);
  command->add_flag("--no-compare", flags->no_compare, "No comparison images with the scene's own");
  command->callback([flags, &options] { run_render(*flags, options); });
}

}  // namespace gflow
