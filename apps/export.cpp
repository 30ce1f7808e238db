// SPDX-License-Identifier: Apache-2.0
// `gflow export`: writes a model as files for other programs.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>

#include "apps/common/command_line.hpp"
#include "apps/common/model_source.hpp"
#include "apps/common/options.hpp"
#include "apps/common/output_path.hpp"
#include "apps/viewer/html.hpp"
#include "apps/viewer/page_files.hpp"
#include "apps/viewer/view_source.hpp"
#include "optim/eval/splatv.hpp"
#include "optim/eval/views.hpp"
#include "optim/formats/dot_splat.hpp"
#include "optim/formats/four_dgs.hpp"
#include "optim/images/movie.hpp"
#include "optim/model/linear_pieces.hpp"
#include "optim/model/selection.hpp"
#include "optim/model/slice.hpp"
#include "optim/runs/run_state.hpp"
#include "optim/scene/cameras_json.hpp"
#include "runtime/base/interrupt.hpp"
#include "runtime/base/lower.hpp"
#include "runtime/base/output.hpp"
#include "runtime/base/progress.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/file_lock.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

struct ExportFlags {
  std::string model, output, format, times;
  int steps = 0, iteration = latest_iteration;
  double fps = 0;
  Undrawable undrawable = Undrawable::left_out;
  Selection selection;
  std::vector<double> crop;
  bool compact = false;
};

// The output format: given by the extension of the name, which --format must not contradict.
// Without an extension --format decides.
std::string format_of(const ExportFlags& flags) {
  static const std::map<std::string, std::string> endings = {
      {".ply", "ply"},   {".splat", "splat"}, {".splatv", "splatv"},
      {".4dgs", "4dgs"}, {".html", "html"},   {".htm", "html"}};
  const std::string ending = lower(fs::path(flags.output).extension().string());
  const auto meant = endings.find(ending);
  const bool sequence = flags.format == "ply-sequence";  // a folder may have any name
  if (meant == endings.end() && !ending.empty() && !sequence)
    throw Error(
        fmt::format("exporting to {}: gflow cannot write {} files; supported are .ply, .splat, "
                    ".splatv, .4dgs, .html and, with --format ply-sequence, a folder of .ply files",
                    flags.output, ending));
  if (meant == endings.end() && flags.format.empty())
    throw Error(fmt::format(
        "exporting to {}: the format is unknown; end the name in .ply, .splat, .splatv, "
        ".4dgs or .html, or give --format",
        flags.output));
  if (meant == endings.end()) return flags.format;
  if (!flags.format.empty() && flags.format != meant->second)
    throw Error(
        fmt::format("exporting to {}: its extension means {}, but --format is {}; change one",
                    flags.output, meant->second, flags.format));
  return meant->second;
}

// The scene of a run, if it still exists.
std::optional<Scene> scene_of(const ModelSource& source) {
  if (!source.run) return std::nullopt;
  if (!fs::exists(source.config.scene.path)) return std::nullopt;
  return load_scene(source.config.scene, source.run->path("frames")).scene;
}

// Times of a sequence: as requested, else (or for "all") the time steps of the run's scene.
std::vector<double> sequence_times(const ExportFlags& flags, const std::optional<Scene>& scene) {
  if (!flags.times.empty() && flags.steps > 0)
    throw Error("--times and --steps exclude each other: both select the times");
  if (!flags.times.empty() && flags.times != "all") return parse_times(flags.times);
  if (flags.steps > 0) return parse_times(fmt::format("0:1:{}", flags.steps));
  if (scene) return step_times(*scene);
  throw Error(
      fmt::format("exporting {}: the number of time steps is unknown without its scene; give {}",
                  flags.model, flags.format == "4dgs" ? "--steps" : "--steps or --times"));
}

double single_time(const ExportFlags& flags) {
  if (flags.steps > 0)
    throw Error(
        fmt::format("--format {} writes a single time, selected with --times; --steps is for "
                    "ply-sequence and 4dgs",
                    flags.format));
  if (flags.times.empty()) return 0.5;
  if (flags.times == "all")
    throw Error(
        fmt::format("--format {} writes a single time, but --times all selects every time step; "
                    "use ply-sequence for several",
                    flags.format));
  const std::vector<double> times = parse_times(flags.times);
  if (times.size() > 1)
    throw Error(fmt::format(
        "--format {} writes a single time, but --times {} selects {}; use ply-sequence for several",
        flags.format, flags.times, times.size()));
  return times[0];
}

// Name of frame k of a sequence, from 0.
std::string frame_name(size_t k) { return fmt::format("frame_{:04}.ply", k + 1); }

// A frame of an earlier, longer sequence would be played with this one. Frames that this sequence
// replaces are allowed: they may be from an interrupted export.
void require_no_other_frames(const std::string& folder, size_t frames) {
  if (!fs::exists(folder)) return;
  std::set<std::string> replaced;
  for (size_t k = 0; k < frames; ++k) replaced.insert(frame_name(k));
  std::string other = fs::is_directory(folder) ? "" : "not a folder";
  std::error_code problem;
  for (const auto& entry : fs::directory_iterator(folder, problem)) {
    const std::string name = entry.path().filename().string();
    if (!replaced.count(name) && !is_temporary_name(name)) other = name;
  }
  if (problem && other.empty()) other = problem.message();
  if (!other.empty())
    throw Error(
        fmt::format("exporting into {}: it exists and is not just frames 1 to {} of a sequence "
                    "({}); choose a new folder",
                    folder, frames, other));
}

// The cameras of the run, else those beside the file; none if there is no cameras.json.
std::vector<Camera> own_cameras(const ModelSource& source) {
  const fs::path beside = source.run ? fs::path(source.run->path("cameras.json"))
                                     : fs::path(source.path).replace_filename("cameras.json");
  if (!fs::exists(beside)) return {};
  return read_cameras_json(beside.string(), 1);
}

// Initial viewpoints of a viewer: own cameras, or an orbit around the model.
std::vector<Camera> viewer_cameras(const ModelSource& source) {
  std::vector<Camera> cameras = own_cameras(source);
  if (!cameras.empty()) return cameras;
  for (const RenderView& view : orbit_views(source.model, parse_times("0:1:8"), "-y"))
    cameras.push_back(view.camera);
  return cameras;
}

// A PLY's comment for viewers.
void add_up(PlyTable& head, const std::optional<std::array<double, 3>>& up) {
  if (up) head.comments.push_back(fmt::format("up {:.6g}", fmt::join(*up, " ")));
}

void export_sequence(Queue& queue, Model& model, const std::vector<double>& times,
                     const std::optional<std::array<double, 3>>& up, const std::string& folder,
                     bool quiet) {
  std::error_code problem;
  fs::create_directories(folder, problem);
  if (problem)
    throw Error(fmt::format("cannot create the folder {}: {}", folder, problem.message()));
  const FolderLock lock(folder);
  require_no_other_frames(folder, times.size());  // another process may have filled it meanwhile
  InterruptGuard guard;
  Progress progress("export", long(times.size()), quiet);
  for (size_t k = 0; k < times.size(); ++k) {
    SliceRows now(queue, model, times[k]);
    PlyTable head = now.head();
    add_up(head, up);
    try {
      write_ply(folder + "/" + frame_name(k), head,
                [&](size_t i, float* values) { now.row(i, values); });
    } catch (const Error& problem) {
      throw Error(
          fmt::format("{}; {} of {} files are in {}", problem.what(), k, times.size(), folder));
    }
    progress.advance();
    if (interrupted())
      throw Interrupted(fmt::format("interrupted after {} of {} files, which are in {}", k + 1,
                                    times.size(), folder));
  }
  progress.finish();
  print_result("written   {} PLY files in {}\n", times.size(), folder);
}

void require_no_times(const ExportFlags& flags) {
  if ((!flags.times.empty() && flags.times != "all") || flags.steps > 0)
    throw Error(fmt::format(
        "--format {} contains all times; --times and --steps are for other formats", flags.format));
}

// The camera looks at the point on its axis that is nearest to the mean of the Gaussians.
Viewpoint viewpoint_of(const Camera& camera, const HostModel& model) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  const std::vector<float>& means = model.groups.at("means");
  for (size_t i = 0; i < model.count; ++i)
    middle += Eigen::Map<const Eigen::Vector3f>(&means[3 * i]).cast<double>() / double(model.count);
  const Eigen::Vector3d position = camera.position(), ahead = camera.viewmat.block<1, 3>(2, 0);
  const double distance = std::max(ahead.dot(middle - position), 1e-3);
  const Eigen::Vector3d target = position + distance * ahead;
  constexpr double kDegrees = 57.29577951308232;
  return {2 * kDegrees * std::atan(0.5 * camera.height / camera.fy),
          {position.x(), position.y(), position.z()},
          {target.x(), target.y(), target.z()}};
}

// Camera positions, at most 16.
std::vector<std::array<double, 3>> eyes_of(const std::vector<Camera>& cameras) {
  const size_t count = std::min<size_t>(cameras.size(), 16);
  std::vector<std::array<double, 3>> eyes;
  for (size_t i = 0; i < count; ++i) {
    const Eigen::Vector3d p = cameras[i * cameras.size() / count].position();
    eyes.push_back({p.x(), p.y(), p.z()});
  }
  return eyes;
}

void export_four_dgs(const ExportFlags& flags, const ModelSource& source,
                     const GlobalOptions& options) {
  if (!flags.times.empty() && flags.times != "all")
    throw Error("--format 4dgs contains all times; --steps sets how many times are sampled");
  const std::optional<Scene> scene = scene_of(source);
  PieceRule rule;
  rule.steps = int(sequence_times(flags, scene).size());
  if (scene) rule.fps = scene->fps;
  if (flags.fps > 0) rule.fps = flags.fps;
  const HostModel& host = source.model;
  Queue queue = open_queue(options);
  Model model(queue, host, Purpose::rendering);
  InterruptGuard guard;
  Progress progress("export", rule.steps, options.quiet);
  MovingSplats pieces = linear_pieces(queue, model, rule, [&] {
    progress.advance();
    if (interrupted()) throw Interrupted("interrupted, nothing was written");
  });
  progress.finish();
  const std::vector<Camera> cameras = viewer_cameras(source);
  pieces.viewpoint = viewpoint_of(cameras[0], host);
  pieces.eyes = eyes_of(cameras);
  pieces.up = mean_up(own_cameras(source));
  write_four_dgs(flags.output, pieces);
  print_result("written   {}, {} Gaussians in {} linear pieces, {:.4g} s\n", flags.output,
               host.count, pieces.splats.size(), pieces.duration);
}

// The near plane of a run; 0 if its cameras.json does not say it.
double near_of(const RunFolder& run) {
  const std::string file = run.path("cameras.json");
  return fs::exists(file) ? read_cameras_json(file, 1)[0].near : 0;
}

// The times at which a Gaussian must be selected, one at least.
std::vector<double> selecting_times(const ExportFlags& flags, const ModelSource& source) {
  if (flags.format == "ply" || flags.format == "splat") return {single_time(flags)};
  const std::optional<Scene> scene = scene_of(source);
  if (flags.format != "splatv") return sequence_times(flags, scene);
  return scene ? step_times(*scene) : parse_times("0:1:40");
}

void select_gaussians(const ExportFlags& flags, ModelSource& source, const GlobalOptions& options) {
  if (flags.selection.is_everything()) return;
  const size_t whole = source.model.count;
  Queue queue = open_queue(options);
  source.model = selected(queue, source.model, flags.selection, selecting_times(flags, source));
  require_some_left(source.model, whole, source.path);
  print_result("selected  {} of {} Gaussians\n", source.model.count, whole);
}

// Frees the host copy of the model once the device has it; only its shape remains.
void export_model(const ExportFlags& flags, ModelSource& source, const GlobalOptions& options) {
  HostModel& host = source.model;
  const bool sequence = flags.format == "ply-sequence";
  if (flags.format == "splatv") {
    require_no_times(flags);
    write_splatv(flags.output, host, viewer_cameras(source));
    print_result("written   {}, {} Gaussians\n", flags.output, host.count);
    return;
  }
  if (flags.format == "4dgs") return export_four_dgs(flags, source, options);
  std::vector<double> times;
  if (sequence) {
    times = sequence_times(flags, scene_of(source));
    require_no_other_frames(flags.output, times.size());
  } else {
    times = {single_time(flags)};
  }
  Queue queue = open_queue(options);
  Model model(queue, host, Purpose::rendering);
  host.groups.clear();
  const auto up = mean_up(own_cameras(source));
  if (sequence) return export_sequence(queue, model, times, up, flags.output, options.quiet);
  SliceRows now(queue, model, times[0]);
  PlyTable head = now.head();
  add_up(head, up);
  const auto row = [&](size_t i, float* values) { now.row(i, values); };
  const size_t rows = now.head().rows;
  if (rows == 0)
    throw Error(
        fmt::format("exporting {}: none of its {} Gaussians is visible at time {}; choose another "
                    "time with --times",
                    flags.model, host.count, times[0]));
  if (flags.format == "ply") write_ply(flags.output, head, row);
  if (flags.format == "splat") write_dot_splat(flags.output, rows, now.sh_degree(), row);
  print_result("written   {}, {} of {} Gaussians, at time {}\n", flags.output, rows, host.count,
               times[0]);
}

// The viewer with the model in one file.
void export_html(const ExportFlags& flags, const GlobalOptions& options) {
  require_no_times(flags);
  ViewDevice device([&] { return std::unique_ptr<Queue>(new Queue(open_queue(options))); });
  ViewSource source(flags.model, flags.iteration, flags.undrawable, device);
  const ViewSource::FileModel model = source.model_of_file(flags.selection, flags.compact);
  const std::string page = page_with_model(page_files(), model.bytes, source.info_of_file());
  write_file_atomically(flags.output, page);
  print_result("written   {}, {} of {} Gaussians, {:.1f} MB; open it in a browser\n", flags.output,
               model.count, model.whole, double(page.size()) / 1e6);
  if (flags.compact)
    print_result("rounded   its pictures have a PSNR of {:.1f} dB against the model's{}\n",
                 model.psnr, model.rounds_motion ? ", before its paths are rounded" : "");
}

// --crop in the selection. Error if the box is empty.
void set_crop(ExportFlags& flags) {
  if (flags.crop.empty()) return;
  auto& box = flags.selection.crop.emplace();
  std::copy(flags.crop.begin(), flags.crop.end(), box.begin());
  for (size_t k = 0; k < 3; ++k)
    if (!(box[k] < box[3 + k]))
      throw Error(fmt::format("--crop has least x y z first: {} from {} to {} is empty", "xyz"[k],
                              box[k], box[3 + k]));
}

void run_export(ExportFlags flags, const GlobalOptions& options) {
  flags.format = format_of(flags);
  set_crop(flags);
  if (flags.compact && flags.format != "html")
    throw Error(fmt::format("--compact is for html files; {} has digits of its own", flags.format));
  if (flags.format == "ply-sequence")
    require_no_folder_of_run(flags.output);
  else
    require_no_file_of_run(flags.output);
  if (flags.format == "html") {
    require_other_file(flags.output, flags.model);
    return export_html(flags, options);
  }
  ModelSource source = model_source(flags.model, flags.iteration, flags.undrawable);
  require_other_file(flags.output, source.path);
  select_gaussians(flags, source, options);
  export_model(flags, source, options);
  const auto& [x, y, z] = source.model.shape.origin;
  const bool restored = flags.format == "ply" || flags.format == "ply-sequence";
  if (!restored && (x != 0 || y != 0 || z != 0))
    print_result("relative to ({}, {}, {}) in world coordinates, which exceed float precision\n", x,
                 y, z);
  if (const double near = source.run ? near_of(*source.run) : 0; near > 0)
    print_result(
        "near      {:.3g} scene units: set the near plane of a viewer to it to see what gflow "
        "draws from within the scene\n",
        near);
  print_state(source.state);
}

}  // namespace

void add_export(CLI::App& app, const GlobalOptions& options) {
  auto flags = std::make_shared<ExportFlags>();
  CLI::App* command = app.add_subcommand("export", "Write a model as files for other viewers");
  command->add_option("RUN|FILE", flags->model, "Run folder of `gflow train`, or any splat file")
      ->check(path_given())
      ->required()
      ->type_name("PATH");
  command
      ->add_option("-o,--output", flags->output,
                   "Output file, replaced if it exists; ply-sequence: output folder")
      ->check(path_given())
      ->required()
      ->type_name("PATH");
  command
      ->add_option(
          "--format", flags->format,
          "Default: by the ending of the output, .ply, .splat, .splatv, .4dgs or .html. ply: one "
          "time, "
          "for every 3DGS viewer; ply-sequence: one PLY per step, for SuperSplat; splat: one time, "
          "without view-dependent colour; splatv: all times of a spacetime or native4d model, for "
          "splaTV and gsplat.js; 4dgs: all times of any model, for players of 4dgs.dev; html: all "
          "times of any model with "
          "a viewer, one file for any browser")
      ->check(choice_of({"ply", "ply-sequence", "splat", "splatv", "4dgs", "html"}));
  command
      ->add_option("--times", flags->times,
                   "ply, splat: the time, 0 to 1; empty: 0.5. ply-sequence: 0:1:40 (40 times from "
                   "0 to 1), a list 0,0.5,1, or all (default): the time steps of the run's scene")
      ->type_name("TIMES");
  command
      ->add_option(
          "--steps", flags->steps,
          "ply-sequence, 4dgs: number of times from 0 to 1; 0: the time steps of the run's scene")
      ->check(number_in(0, 100000));
  command
      ->add_option("--fps", flags->fps,
                   "4dgs: time steps per second; 0: as in the run's scene, else 24")
      ->check(zero_or_in(slowest_fps, fastest_fps));
  command
      ->add_option("--min-opacity", flags->selection.min_opacity,
                   "Only Gaussians whose greatest opacity over time is at least this")
      ->check(number_in(0, 1));
  command
      ->add_option(
          "--max-size", flags->selection.max_size,
          "Only Gaussians whose longest standard deviation is at most this, in scene units; "
          "0: any")
      ->check(number_in(0, 1e15));
  command
      ->add_option("--crop", flags->crop,
                   "Only Gaussians with their centre in this box of world coordinates at one of "
                   "the times: least x y z, greatest x y z")
      ->expected(6)
      ->type_name("NUMBERS");
  command->add_flag(
      "--compact", flags->compact,
      "html: rounds the numbers of the model, for a smaller file, and prints the loss");
  add_iteration(*command, flags->iteration);
  add_strict(*command, flags->undrawable);
  command->callback([flags, &options] { run_export(*flags, options); });
}

}  // namespace gflow
