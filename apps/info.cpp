// SPDX-License-Identifier: Apache-2.0
// `gflow info`: contents of a splat file, a run or a scene. Needs no device.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
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
#include "runtime/base/output.hpp"
#include "runtime/files/atomic_file.hpp"
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
  return info_of_model(read_model(path, undrawable), path, names_of(format)[size_t(format)],
                       fs::file_size(path));
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
          {"bits", video.bits},
          {"colors", video.colors},
          {"frame_rate", video.variable ? "variable" : "constant"}};
}

// Times of the frames in [0, 1], if they are not evenly spaced.
Json times_of(const Scene& scene) {
  Json times = Json::array();
  for (const Frame& frame : scene.train) times.push_back(std::round(frame.time * 1e6) / 1e6);
  return times;
}

Json info_of(const Scene& scene, const std::string& path) {
  std::set<std::string> sizes;
  for (const Camera& camera : scene.cameras)
    sizes.insert(fmt::format("{}x{}", camera.width, camera.height));
  return {{"scene", path},
          {"layout", scene.layout},
          {"cameras", scene.cameras.size()},
          {"resolutions", sizes},
          {"train_frames", scene.train.size()},
          {"test_frames", scene.test.size()},
          {"val_frames", scene.val.size()},
          {"steps", scene.steps},
          {"fps", scene.fps},
          {"alpha", scene.has_alpha},
          {"points", scene.points.size()},
          {"extent", scene.extent},
          {"origin", scene.origin},
          {"notices", scene.notices}};
}

// A plain video is a scene as well.
Json info_of_file(const std::string& path, Undrawable undrawable) {
  try {
    splat_format(path);
  } catch (const Error& no_splat) {
    require_file(path);
    for (const char* splats : {".ply", ".splat", ".spz", ".4dgs"})
      if (fs::path(path).extension() == splats) throw;
    try {
      video_info(path);
    } catch (const Error& no_video) {
      throw Error(
          fmt::format("{}; it is not a video either: {}", no_splat.what(), no_video.what()));
    }
    const Scene scene = read_scene(path);
    Json info = info_of(scene, path);
    info.update(info_of_video(path));
    if (info["frame_rate"] == "variable") info["times"] = times_of(scene);
    return info;
  }
  return info_of_splats(path, undrawable);
}

Json info_of(const std::string& path, int iteration, Undrawable undrawable) {
  if (fs::is_directory(path) && RunFolder::is_run(path)) return info_of_run(path, iteration);
  require_no_iteration(iteration, path);
  return fs::is_directory(path) ? info_of(read_scene(path), path) : info_of_file(path, undrawable);
}

std::string text_of(const Json& value) {
  if (value.is_string()) return value.get<std::string>();
  if (value.is_number_float()) return fmt::format("{:.5g}", value.get<double>());
  std::string text;
  if (value.is_array()) {
    for (const Json& item : value) text += (text.empty() ? "" : ", ") + text_of(item);
    return value.empty() ? "none" : text;
  }
  if (!value.is_object()) return value.dump();
  for (const auto& [key, item] : value.items())
    text += fmt::format("{}{} {}", text.empty() ? "" : "; ", key, text_of(item));
  return value.empty() ? "none" : text;
}

// Units of the printed values, by their JSON key.
std::string unit_of(const std::string& key) {
  if (key == "bounds" || key == "scale" || key == "extent") return " [scene units]";
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
    std::replace(name.begin(), name.end(), '_', ' ');
    print_result("{:<18} {}{}\n", name, text, unit_of(key));
  }
}

}  // namespace

void add_info(CLI::App& app, const GlobalOptions&) {
  struct Flags {
    std::string path;
    int iteration = latest_iteration;
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
  add_strict(*command, flags->undrawable);
  command->add_flag("--json", flags->json, "Print JSON");
  command->callback([flags] {
    const Json info = info_of(flags->path, flags->iteration, flags->undrawable);
    if (flags->json)
      fmt::print("{}\n", json_text(info, 1));
    else
      print_info(info);
  });
}

}  // namespace gflow
