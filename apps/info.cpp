// SPDX-License-Identifier: Apache-2.0
// `gflow info`: contents of a splat file, a run or a scene. Needs no device.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "apps/common/command_line.hpp"
#include "apps/common/model_source.hpp"
#include "apps/common/options.hpp"
#include "optim/eval/views.hpp"
#include "optim/formats/four_dgs.hpp"
#include "optim/formats/splat_table.hpp"
#include "optim/images/video.hpp"
#include "optim/scene/cameras_json.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "runtime/base/lower.hpp"
#include "runtime/base/output.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/is_zip.hpp"
#include "runtime/files/json_text.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// {"min", "median", "max"}, empty for no values. `shown` converts these three values only; it must
// be increasing.
template <class Value, class Shown>
Json range_of(std::vector<Value> values, Shown shown) {
  if (values.empty()) return Json::object();
  const auto middle = values.begin() + long(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  const auto [low, high] = std::minmax_element(values.begin(), values.end());
  return {{"min", shown(*low)}, {"median", shown(*middle)}, {"max", shown(*high)}};
}
template <class Value>
Json range_of(std::vector<Value> values) {
  return range_of(std::move(values), [](Value value) { return double(value); });
}

std::vector<float> column_values(const PlyTable& table, size_t column) {
  std::vector<float> values;
  values.reserve(table.rows);
  for (size_t i = 0; i < table.rows; ++i)
    values.push_back(table.values[i * table.names.size() + column]);
  return values;
}

Json opacities_of(const HostModel& model) {
  return range_of(model.groups.at("logit_opacities"),
                  [](float logit) { return opacity_of_logit(logit); });
}

// Range of some columns of log_scales [N, 4].
Json scales_of(const HostModel& model, size_t first, size_t last, double unit) {
  std::vector<float> values;
  values.reserve(model.count * (last - first + 1));
  const std::vector<float>& log_scales = model.groups.at("log_scales");
  for (size_t i = 0; i < model.count; ++i)
    for (size_t k = first; k <= last; ++k) values.push_back(log_scales[4 * i + k]);
  return range_of(std::move(values), [&](float log) { return std::exp(double(log)) / unit; });
}

Json bounds_of(const HostModel& model) {
  Json low = Json::array(), high = Json::array();
  const std::vector<float>& means = model.groups.at("means");
  for (size_t k = 0; k < 3 && model.count > 0; ++k) {
    float least = means[k], most = means[k];
    for (size_t i = 1; i < model.count; ++i) {
      least = std::min(least, means[3 * i + k]);
      most = std::max(most, means[3 * i + k]);
    }
    low.push_back(least);
    high.push_back(most);
  }
  return {{"min", low}, {"max", high}};
}

Json info_of_four_dgs(const std::string& path) {
  const MovingSplats scene = read_four_dgs(path);
  Json low = Json::array(), high = Json::array();
  std::vector<double> opacities, scales, shown;
  for (const MovingSplat& s : scene.splats) {
    opacities.push_back(s.opacity);
    scales.insert(scales.end(), s.scales.begin(), s.scales.end());
    shown.push_back(s.end - s.begin);
  }
  // Evaluated at half of the duration: positions outside a Gaussian's window are not meant to be
  // seen.
  const PlyTable now = splats_at(scene, scene.duration / 2);
  for (size_t k = 0; k < 3 && now.rows > 0; ++k) {
    const Json range = range_of(column_values(now, k));
    low.push_back(range["min"]);
    high.push_back(range["max"]);
  }
  return {{"file", path},
          {"format", "4dgs"},
          {"size_bytes", fs::file_size(path)},
          {"gaussians", scene.splats.size()},
          {"gaussians_half_way", now.rows},
          {"sh_degree", scene.sh_degree},
          {"seconds", scene.duration},
          {"cutoff", scene.cutoff},
          {"bounds", {{"min", low}, {"max", high}}},
          {"opacity", range_of(opacities)},
          {"scale", range_of(scales)},
          {"window_seconds", range_of(shown)}};
}

// Describes the model in the file at `path`.
Json info_of_model(const HostModel& model, const std::string& path, const std::string& format,
                   uintmax_t bytes) {
  const bool still = is_static_model(model);
  size_t floats = 0;
  for (const auto& group : model.groups) floats += group.second.size();
  Json info{{"file", path},
            {"format", format},
            {"size_bytes", bytes},
            {"gaussians", model.count},
            {"sh_degree", model.shape.sh_degree},
            {"motion", still ? "none" : name_of(model.shape.motion)},
            {"memory_bytes", floats * sizeof(float)},
            {"bounds", bounds_of(model)},
            {"origin", model.shape.origin},
            {"opacity", opacities_of(model)},
            {"scale", scales_of(model, 0, 2, 1)}};
  if (!still) {
    info["duration"] = model.shape.duration;
    info["cutoff"] = model.shape.cutoff;
    info["lifetime"] = scales_of(model, 3, 3, model.shape.duration);
  }
  return info;
}

Json info_of_splats(const std::string& path, Undrawable undrawable) {
  const SplatFormat format = splat_format(path);
  if (format == SplatFormat::four_dgs) return info_of_four_dgs(path);
  return info_of_model(read_model(path, undrawable), path, name_of(format), fs::file_size(path));
}

Json info_of_run(const std::string& path, int iteration) {
  const RunFolder run = RunFolder::open(path);
  const RunState state = read_run_state(run, iteration);
  Json info{{"run", path},
            {"scene", state.config.scene.path},
            {"state", state.text()},
            {"iterations", state.iteration},
            {"saved_iterations", iterations_of(run)}};
  if (std::isfinite(state.facts.train_seconds)) info["train_seconds"] = state.facts.train_seconds;
  if (!state.facts.device.empty()) info["device"] = state.facts.device;
  if (const std::string file = run.path("cameras.json"); fs::exists(file))
    if (const double near = read_cameras_json(file, 1)[0].near; near > 0) info["near_plane"] = near;
  info.update(
      info_of_model(state.model, state.path, state.checkpoint ? "checkpoint" : "ply", state.bytes));
  return info;
}

// How a video is stored and shown.
Json info_of_video(const std::string& path) {
  const VideoInfo video = video_info(path);
  return {{"codec", video.codec},
          {"stored_size", fmt::format("{}x{}", video.stored_width, video.stored_height)},
          {"pixel_aspect", video.pixel_aspect},
          {"rotation", video.rotation},
          {"mirrored", video.mirrored},
          {"interlaced", video.interlaced},
          {"bits", video.bits},
          {"colors", video.colors},
          {"frame_rate", video.variable ? "variable; fps is the average" : "constant"},
          {"seconds", video.times.empty() ? video.seconds : video.times.back() + 1 / video.fps}};
}

// Distinct times of the training frames in [0, 1].
Json times_of(const Scene& scene) {
  Json times = Json::array();
  for (const double time : distinct_times(scene.train))
    times.push_back(std::round(time * 1e6) / 1e6);
  return times;
}

// As scene.skip_cameras and scene.time_offsets take them.
Json camera_names(const Scene& scene) {
  Json names = Json::array();
  for (const Camera& camera : scene.cameras)
    if (std::find(names.begin(), names.end(), camera.name) == names.end())
      names.push_back(camera.name);
  return names;
}

// How many training images have a depth file.
std::string depth_of(const Scene& scene) {
  const auto count = std::count_if(scene.train.begin(), scene.train.end(),
                                   [](const Frame& frame) { return !frame.depth_path.empty(); });
  return count == 0 ? "none" : fmt::format("{} of {} training images", count, scene.train.size());
}

// How many images have a mask, and what it means.
std::string masks_of(const Scene& scene, const std::string& path) {
  size_t masked = 0, all = 0;
  for (const std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val})
    for (const Frame& frame : *split) masked += !frame.mask_path.empty(), ++all;
  const std::string segments = path + "/seg";
  if (masked == 0 && scene.layout == "panoptic" && std::filesystem::is_directory(segments))
    return segments + ", not used unless scene.masks is foreground or alpha";
  if (masked == 0) return "none";
  return fmt::format("{} of {} images; black {}", masked, all,
                     scene.masks == Masks::ignore  ? "takes no part in the training"
                     : scene.masks == Masks::alpha ? "is transparent"
                                                   : "is background");
}

// Distortion that is removed from the images.
std::string lenses_of(const Scene& scene) {
  std::set<std::string> kinds;
  for (const Camera& camera : scene.cameras)
    kinds.insert(camera.lens.kind == Lens::Kind::none     ? "no distortion"
                 : camera.lens.kind == Lens::Kind::radial ? "radial distortion, removed"
                                                          : "fisheye, made rectilinear");
  return fmt::format("{}", fmt::join(kinds, "; "));
}

Json info_of(const Scene& scene, const std::string& path) {
  std::set<std::string> sizes;
  for (const Camera& camera : scene.cameras)
    sizes.insert(fmt::format("{}x{}", camera.width, camera.height));
  Json info{{"scene", path},
            {"layout", scene.layout},
            {"cameras", scene.cameras.size()},
            {"camera_names", camera_names(scene)},
            {"resolutions", sizes},
            {"train_frames", scene.train.size()},
            {"test_frames", scene.test.size()},
            {"val_frames", scene.val.size()},
            {"steps", scene.steps},
            {"times", times_of(scene)},
            {"fps", scene.fps},
            {"lens", lenses_of(scene)},
            {"alpha", scene.has_alpha},
            {"masks", masks_of(scene, path)},
            {"depth", depth_of(scene)},
            {"points", scene.points.size()}};
  if (scene.points.size() > 0) {
    info["points_file"] = scene.points.source;
    info["points_in_view"] = share_of_points_in_view(scene);
  }
  info.update({{"extent", scene.extent},
               {"near_plane", scene.near_plane},
               {"origin", scene.origin},
               {"notices", scene.notices}});
  return info;
}

// Whether a file is certainly no video, so that trying to read one would only make the error
// longer.
bool is_no_video(const std::string& path) {
  const std::string ending = lower(fs::path(path).extension().string());
  constexpr std::array splats = {".ply", ".splat",  ".spz", ".4dgs",
                                 ".sog", ".ksplat", ".glb", ".gltf"};
  return is_zip(path) || std::find(splats.begin(), splats.end(), ending) != splats.end();
}

// A plain video is a scene as well.
Json info_of_file(const std::string& path, Undrawable undrawable, const SceneOptions& options) {
  try {
    splat_format(path);
  } catch (const Error& no_splat) {
    require_file(path);
    if (is_no_video(path)) throw;
    try {
      video_info(path);
    } catch (const Error& no_video) {
      if (has_video_extension(path)) throw;
      throw Error(
          fmt::format("{}; it is not a video either: {}", no_splat.what(), no_video.what()));
    }
    const Scene scene = read_scene(path, options);
    Json info = info_of(scene, path);
    info.update(info_of_video(path));
    return info;
  }
  return info_of_splats(path, undrawable);
}

// The [scene] settings among defaults; Error for any other.
SceneOptions scene_options(const std::vector<std::string>& settings) {
  TrainOptions options;
  for (const std::string& setting : settings) {
    if (setting.rfind("scene.", 0) != 0)
      throw Error(
          fmt::format("--set {}: expected a setting of [scene], which says how the files "
                      "are read",
                      setting));
    apply_setting(options, setting);
  }
  check(options);
  return options.scene;
}

Json info_of(const std::string& path, int iteration, Undrawable undrawable,
             const SceneOptions& options) {
  if (fs::is_directory(path) && RunFolder::is_run(path)) return info_of_run(path, iteration);
  require_no_iteration(iteration, path);
  return fs::is_directory(path) ? info_of(read_scene(path, options), path)
                                : info_of_file(path, undrawable, options);
}

std::string text_of(const Json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_number_float()) return fmt::format("{:.5g}", value.get<double>());
  std::string text;
  if (value.is_array()) {
    constexpr size_t most = 8, shown = 3;  // of a longer list the first ones and the last
    for (size_t i = 0; i < value.size(); ++i) {
      const bool left_out = value.size() > most && i >= shown && i + 1 < value.size();
      if (left_out && i == shown) text += ", ...";
      if (!left_out) text += (text.empty() ? "" : ", ") + text_of(value[i]);
    }
    return value.empty() ? "none" : text;
  }
  if (!value.is_object()) return value.dump();
  for (const auto& [key, item] : value.items())
    text += fmt::format("{}{} {}", text.empty() ? "" : "; ", key, text_of(item));
  return value.empty() ? "none" : text;
}

// Units of the printed values, by their JSON key.
std::string unit_of(const std::string& key) {
  if (key == "bounds" || key == "scale" || key == "extent" || key == "near_plane")
    return " [scene units]";
  if (key == "lifetime") return " [lengths of the video]";
  if (key == "duration") return " [model time]";
  return "";
}

void print_info(const Json& info) {
  for (const auto& [key, value] : info.items()) {
    std::string name = key, text = text_of(value);
    if (key.size() > 6 && key.substr(key.size() - 6) == "_bytes") {
      name = key.substr(0, key.size() - 6);
      const double bytes = value.get<double>();
      text =
          bytes < 1e5 ? fmt::format("{} bytes", bytes) : fmt::format("{:.1f} MiB", bytes / 1048576);
    }
    if (key == "points_in_view")
      text = fmt::format("{:.0f} % (in front of a training camera and inside its image)",
                         100 * value.get<double>());
    std::replace(name.begin(), name.end(), '_', ' ');
    if (key == "notices") {
      for (const Json& notice : value) print_result("note: {}\n", notice.get<std::string>());
      continue;
    }
    print_result("{:<18} {}{}\n", name, text, unit_of(key));
  }
}

}  // namespace

void add_info(CLI::App& app, const GlobalOptions&) {
  struct Flags {
    std::string path;
    int iteration = latest_iteration;
    std::vector<std::string> settings;
    Undrawable undrawable = Undrawable::left_out;
    bool json = false;
  };
  auto flags = std::make_shared<Flags>();
  CLI::App* command = app.add_subcommand("info",
                                         "Print the contents of a splat file, a run or a scene "
                                         "(reads only the first bytes of images)");
  command->add_option("PATH", flags->path, "Splat file, run folder or scene folder")
      ->check(path_given())
      ->required()
      ->type_name("PATH");
  add_iteration(*command, flags->iteration);
  command
      ->add_option("--set", flags->settings,
                   "A setting of [scene] as for `gflow train`, e.g. --set scene.masks=alpha; may "
                   "be repeated")
      ->type_name("SECTION.KEY=VALUE")
      ->expected(1)
      ->default_str("")
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  add_strict(*command, flags->undrawable);
  command->add_flag("--json", flags->json, "Print JSON");
  command->callback([flags] {
    const Json info =
        info_of(flags->path, flags->iteration, flags->undrawable, scene_options(flags->settings));
    if (flags->json)
      fmt::print("{}\n", json_text(info, 1));
    else
      print_info(info);
  });
}

}  // namespace gflow
