// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/run_folder.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "optim/runs/replacement.hpp"
#include "optim/runs/run_names.hpp"
#include "optim/scene/cameras_json.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/json_text.hpp"
#include "runtime/files/modest_json.hpp"
#include "runtime/files/text_file.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;
using OrderedJson = nlohmann::ordered_json;

void write_text(const std::string& path, const std::string& text) {
  write_file_atomically(path, Bytes(text.begin(), text.end()));
}

// Appends lines to a file, or begins it anew. Undone on failure.
void append_lines(const std::string& file, bool anew, const std::string& lines) {
  std::error_code none;
  const uintmax_t before = !anew && fs::exists(file) ? fs::file_size(file, none) : 0;
  std::ofstream out(file, anew ? std::ios::trunc : std::ios::app);
  out << lines;
  out.flush();
  if (out) return;
  const Error error(fmt::format("cannot write {}: {}", file, std::strerror(errno)));
  out.close();
  fs::resize_file(file, before, none);
  throw error;
}

// JSON has no NaN.
OrderedJson number(double value) {
  return std::isfinite(value) ? OrderedJson(value) : OrderedJson(nullptr);
}

// Names in a line of metrics.jsonl: the columns of metrics.csv.
std::vector<std::string> names_of_line(const OrderedJson& line) {
  std::vector<std::string> names;
  for (const auto& item : line.items()) names.push_back(item.key());
  return names;
}
std::string csv_row(const std::vector<std::string>& cells) {
  return fmt::format("{}\n", fmt::join(cells, ","));
}
// A line as a CSV row with these columns. Non-finite or missing values are empty cells.
std::string csv_row(const OrderedJson& line, const std::vector<std::string>& columns) {
  std::vector<std::string> cells;
  for (const std::string& column : columns) {
    auto value = line.find(column);
    // The former name, which the table of a run that was begun with it keeps.
    if (value == line.end() && column == "refused") value = line.find("rejected");
    cells.push_back(value == line.end() || value->is_null() ? "" : value->dump());
  }
  return csv_row(cells);
}
// The columns of a table; none if the file is missing or empty.
std::vector<std::string> columns_of(const std::string& path) {
  std::ifstream table(path);
  std::string header;
  std::getline(table, header);
  std::vector<std::string> columns;
  std::istringstream names(header);
  for (std::string column; std::getline(names, column, ',');) columns.push_back(column);
  return columns;
}

OrderedJson metrics_of_view(const ViewMetrics& view) {
  OrderedJson figures;
  for (const auto& [name, value] : view_figures()) figures[name] = number(view.*value);
  return figures;
}

// Mean of each metric over the views of each time step.
OrderedJson figures_by_step(const std::vector<ViewMetrics>& views) {
  int steps = 0;
  for (const ViewMetrics& view : views) steps = std::max(steps, view.step + 1);
  OrderedJson all = OrderedJson::object();
  for (const auto& [name, value] : view_figures()) {
    std::vector<double> sums(size_t(steps), 0.0), counts(size_t(steps), 0.0);
    for (const ViewMetrics& view : views) {
      if (!std::isfinite(view.*value)) continue;
      sums[size_t(view.step)] += view.*value;
      ++counts[size_t(view.step)];
    }
    for (size_t k = 0; k < sums.size(); ++k) all[name].push_back(number(sums[k] / counts[k]));
  }
  return all;
}

// Path of a network, or null if there is none.
OrderedJson network(const std::string& path) {
  return path.empty() ? OrderedJson(nullptr) : OrderedJson(path);
}

// Whether a folder contains more than a lock and temporary files, which a training killed at its
// start leaves.
bool holds_something(const std::string& folder) {
  std::error_code problem;
  for (const auto& entry : fs::directory_iterator(folder, problem)) {
    const std::string name = entry.path().filename().string();
    if (name != kRunLock && !is_temporary_name(name)) return true;
  }
  return false;
}

// Sets `config` to the settings of the last readable checkpoint and returns its path; leaves it
// unchanged and returns "" if there is none.
std::string last_settings(const CheckpointFolder& checkpoints, TrainOptions& config) {
  for (const int step : checkpoints.steps()) {
    const std::string path = checkpoints.path(step);
    try {
      TrainOptions kept;
      apply_text(kept, read_checkpoint_facts(path).config, "the settings in " + path);
      check(kept);
      config = kept;
      return path;
    } catch (const Error&) {  // reported when the checkpoint itself is read
    }
  }
  return "";
}

std::vector<std::string> those_there(std::vector<std::string> paths) {
  const auto is_missing = [](const std::string& path) {
    std::error_code none;
    return !fs::exists(fs::symlink_status(path, none));
  };
  paths.erase(std::remove_if(paths.begin(), paths.end(), is_missing), paths.end());
  return paths;
}

}  // namespace

void RunFolder::make() const {
  if (folder_.empty()) throw Error("the name of the run folder is empty: set it with -o FOLDER");
  std::error_code problem;
  // Only run folders may be replaced; other folders are not ours.
  if (holds_something(folder_) && !is_made_by_training(folder_))
    throw Error(
        fmt::format("training into {}: it is not empty and not a run folder; name a new folder, or "
                    "a previous run to replace",
                    folder_));
  if (fs::is_symlink(folder_, problem) && !fs::exists(folder_, problem))
    throw Error(
        fmt::format("creating run folder {}: it is a link to {}, which does not exist; create that "
                    "folder, or name another",
                    folder_, fs::read_symlink(folder_).string()));
  fs::create_directories(folder_, problem);
  if (problem) throw Error(fmt::format("creating run folder {}: {}", folder_, problem.message()));
}

RunFolder RunFolder::create(const std::string& path) {
  const RunFolder run(path);
  run.make();
  return run;
}

FileLock RunFolder::lock() const { return FileLock(path(kRunLock), folder_); }

std::unique_ptr<FileLock> RunFolder::lock_if_free() const {
  try {
    return std::make_unique<FileLock>(path(kRunLock), folder_);
  } catch (const FileIsLocked&) {
    return nullptr;
  }
}

bool RunFolder::is_run(const std::string& path) {
  const RunFolder run(path);
  return fs::exists(run.path("config.toml")) || is_beginning(run) ||
         !run.checkpoints().steps().empty();
}

void RunFolder::require_no_beginning(const std::string& path) {
  const RunFolder run(path);
  if (!is_run(path) && fs::exists(run.path(kRunLock))) run.lock();
}

RunFolder RunFolder::open(const std::string& path) {
  require_no_beginning(path);
  if (!is_run(path))
    throw Error(fmt::format(
        "{} is not a run folder: it has no config.toml, which `gflow train -o {}` writes", path,
        path));
  const RunFolder run(path);
  try {
    complete_beginning(run);
  } catch (const Error& problem) {
    warn(problem.what());
  }
  return run;
}

std::string RunFolder::model_path(int iteration) const {
  return path(fmt::format("point_cloud/iteration_{}/point_cloud.ply", iteration));
}

std::vector<int> RunFolder::models() const {
  std::vector<int> iterations;
  std::error_code none;  // a training process may remove the folder meanwhile
  for (const auto& entry : fs::directory_iterator(path("point_cloud"), none)) {
    const int iteration = iteration_of_name(entry.path().filename().string());
    if (iteration >= 0 && fs::exists(entry.path() / "point_cloud.ply"))
      iterations.push_back(iteration);
  }
  std::sort(iterations.rbegin(), iterations.rend());
  return iterations;
}

void RunFolder::write_model(int iteration, const HostModel& model) const {
  const std::string folder = fs::path(model_path(iteration)).parent_path().string();
  std::error_code problem;
  fs::create_directories(folder, problem);
  if (problem) throw Error(fmt::format("cannot create {}: {}", folder, problem.message()));
  flush_folder_of(folder);
  gflow::write_model(model_path(iteration), model);
}

void RunFolder::remove_model(int iteration) const {
  fs::remove_all(fs::path(model_path(iteration)).parent_path());
}

void RunFolder::require_its_folders() const {
  for (const char* name : {"checkpoints", "point_cloud", "flow", "frames", "test"}) {
    const std::string folder = path(name);
    std::error_code problem, none;
    fs::directory_iterator(folder, problem);
    if (!problem || !fs::exists(fs::symlink_status(folder, none))) continue;
    if (fs::is_symlink(folder, none) && !fs::exists(folder, none))
      throw Error(
          fmt::format("training into {}: {} is a link to {}, which does not exist; restore it, or "
                      "remove the link",
                      folder_, folder, fs::read_symlink(folder, none).string()));
    throw Error(
        fmt::format("training into {}: cannot list {}: {}", folder_, folder, problem.message()));
  }
}

std::vector<std::string> RunFolder::training() const {
  std::vector<std::string> paths{path("training.json")};
  for (const int step : checkpoints().steps()) paths.push_back(checkpoints().path(step));
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(path("point_cloud"), none))
    if (iteration_of_name(entry.path().filename().string()) >= 0) paths.push_back(entry.path());
  for (const char* name :
       {"metrics.jsonl", "metrics.csv", "input.ply", "input.motion.npz", "broken.npz"})
    paths.push_back(path(name));
  return those_there(std::move(paths));
}

bool RunFolder::would_remove(const std::string& file) const {
  if (file.empty()) return false;
  const fs::path real = fs::weakly_canonical(file);
  for (const char* name :
       {"cameras.json", "checkpoints", "flow", "frames", "input.ply", "point_cloud", "test"}) {
    const fs::path inside = real.lexically_relative(fs::weakly_canonical(path(name)));
    if (!inside.empty() && *inside.begin() != "..") return true;
  }
  return false;
}

std::vector<std::string> RunFolder::results() const {
  std::vector<std::string> paths{path("test"), path("compare.png")};
  std::error_code none;
  for (const auto& entry : fs::directory_iterator(folder_, none))
    if (is_name_of_results(entry.path().filename().string())) paths.push_back(entry.path());
  return those_there(std::move(paths));
}

void RunFolder::remove_results() const {
  for (const std::string& path : results()) fs::remove_all(path);
}

bool RunFolder::holds_training() const {
  return !checkpoints().steps().empty() || !models().empty() || fs::exists(path("training.json")) ||
         !results().empty();
}

void RunFolder::forget_unfinished_files() const {
  std::vector<fs::path> unfinished;
  const std::function<void(const fs::path&)> look_into = [&](const fs::path& folder) {
    std::error_code problem;
    for (fs::directory_iterator entry(folder, problem), end; !problem && entry != end;
         entry.increment(problem)) {
      const std::string name = entry->path().filename().string();
      const bool is_own = folder == folder_;  // its subfolders may be links to other disks
      const bool trains_there = !is_own || is_name_of_training(name);
      if (is_left_behind(name))
        unfinished.push_back(entry->path());
      else if (trains_there && fs::is_directory(is_own ? entry->status() : entry->symlink_status()))
        look_into(entry->path());
    }
    // A missing folder is fine: another process has removed it.
    if (problem && problem != std::errc::no_such_file_or_directory)
      throw Error(fmt::format("cannot list {}: {}", folder.string(), problem.message()));
  };
  look_into(folder_);
  for (const fs::path& file : unfinished) {
    std::error_code problem;
    fs::remove_all(file, problem);
    if (problem) throw Error(fmt::format("cannot remove {}: {}", file.string(), problem.message()));
  }
}

void RunFolder::remove_stale_caches(const std::string& stamp) const {
  if (has_caches_of(stamp)) return;
  for (const char* folder : {"flow", "frames"}) fs::remove_all(path(folder));
  write_text(path(kRunStamp), stamp);
}

bool RunFolder::has_caches_of(const std::string& stamp) const {
  return fs::exists(path(kRunStamp)) && stamp == read_report_or_empty(path(kRunStamp));
}

void RunFolder::write_config(const TrainOptions& config) const {
  write_text(path("config.toml"), to_toml(config));
}

TrainOptions RunFolder::read_config() const {
  TrainOptions kept;
  const std::string checkpoint = last_settings(checkpoints(), kept);
  try {
    TrainOptions config = kept;
    if (fs::is_regular_file(path("config.toml")) && fs::file_size(path("config.toml")) == 0)
      throw Error(fmt::format(
          "reading the configuration {}: it is empty, but should contain all settings of the run",
          path("config.toml")));
    apply_file(config, path("config.toml"));
    check(config);
    return config;
  } catch (const Error& problem) {
    if (checkpoint.empty()) throw;
    warn(fmt::format("{}; using the settings saved in {}", problem.what(), checkpoint));
    return kept;
  }
}

void RunFolder::write_cameras(const Scene& scene) const {
  write_text(path("cameras.json"), cameras_json(scene.cameras));
}

void RunFolder::append_metrics(int iteration, double seconds, const StepReport& report) const {
  OrderedJson line{{"iteration", iteration}, {"seconds", seconds}, {"loss", number(report.loss)}};
  for (const Term& term : report.terms) line[term.name] = number(term.value);
  line.update({{"num_gaussians", report.gaussians},
               {"num_moving", report.moving},
               {"rejected", report.rejected}});
  append_lines(path("metrics.jsonl"), iteration == 0, json_text(line) + "\n");
  const std::string table = path("metrics.csv");
  const std::vector<std::string> there =
      iteration == 0 ? std::vector<std::string>{} : columns_of(table);
  const std::vector<std::string> columns = there.empty() ? names_of_line(line) : there;
  append_lines(table, there.empty(),
               (there.empty() ? csv_row(columns) : "") + csv_row(line, columns));
}

OrderedJson RunFolder::metrics_of(std::string_view line) {
  constexpr size_t longest = size_t{64} << 10;
  OrderedJson none(OrderedJson::value_t::discarded);
  // Checked before parsing: the parser takes microseconds per error, and a log may have millions of
  // lines.
  if (line.size() > longest || line.empty() || line.front() != '{') return none;
  OrderedJson parsed = parse_json_within_limits(line);
  const bool is_line =
      parsed.is_object() && parsed.contains("iteration") && parsed["iteration"].is_number_integer();
  return is_line ? parsed : none;
}

void RunFolder::keep_metrics_before(int iteration) const {
  std::string kept = read_text_or_empty(path("metrics.jsonl")), table;
  std::vector<std::string> columns;
  size_t end = 0;  // end of the kept text
  int number = 1;
  for (std::string_view rest = kept; !rest.empty(); ++number) {
    const std::string_view text = take_line(rest);
    const OrderedJson line = metrics_of(text);
    // The last line of a killed process may be cut off.
    const bool cut_off = rest.empty() && text.substr(0, 1) == "{";
    if (line.is_discarded() && !cut_off)
      warn(fmt::format(
          "{}: line {} was not written by `gflow train`: it and all following lines are dropped",
          path("metrics.jsonl"), number));
    if (line.is_discarded() || line["iteration"] >= iteration) break;
    if (end == 0) columns = names_of_line(line), table = csv_row(columns);
    table += csv_row(line, columns);
    end = kept.size() - rest.size();
  }
  kept.resize(end);
  if (end > 0 && kept.back() != '\n') kept += '\n';
  if (kept.empty()) {
    for (const char* name : {"metrics.jsonl", "metrics.csv"}) fs::remove(path(name));
    return;
  }
  for (const auto& [name, text] : {std::pair("metrics.jsonl", &kept), {"metrics.csv", &table}})
    if (*text != read_text_or_empty(path(name))) write_text(path(name), *text);
}

std::vector<std::string> RunFolder::write_results(const Evaluation& evaluation,
                                                  const std::string& split, const RunFacts& facts,
                                                  const TrainOptions& config, size_t gaussians,
                                                  bool latest) const {
  const std::string suffix =
      fmt::format("{}{}.json", split == "test" ? "" : "_" + split,
                  latest ? "" : fmt::format("_iteration_{}", facts.iterations));
  const std::string of_all = path("results" + suffix), of_each = path("per_view" + suffix);
  OrderedJson views = OrderedJson::object();
  for (const ViewMetrics& view : evaluation.views) views[view.name] = metrics_of_view(view);
  write_text(of_each, json_text(views, 1) + "\n");
  OrderedJson test = metrics_of_view(evaluation.mean);
  test["by_step"] = figures_by_step(evaluation.views);
  test["flow_reference"] = evaluation.flow_reference;
  test["views"] = evaluation.views.size();
  test["trained_on"] = evaluation.trained_on;
  test["lpips_model"] = network(evaluation.lpips_model);
  test["clip_model"] = network(evaluation.clip_model);
  if (const auto& tracks = evaluation.tracks)
    test["tracks"] = {{"mean", tracks->mean},     {"median", tracks->median},
                      {"end", tracks->end},       {"by_step", tracks->by_step},
                      {"motion", tracks->motion}, {"motion_by_step", tracks->motion_by_step},
                      {"still", tracks->still},   {"lost", tracks->lost}};
  if (const auto& tracks = evaluation.tracks; tracks && tracks->seen)
    test["tracks"]["seen"] = {{"share", tracks->seen->share},
                              {"mean", tracks->seen->mean},
                              {"motion", tracks->seen->motion},
                              {"by_step", tracks->seen->by_step},
                              {"motion_by_step", tracks->seen->motion_by_step}};
  const OrderedJson results{{split, test},
                            {"num_gaussians", gaussians},
                            {"iterations", facts.iterations},
                            {"train_seconds", number(facts.train_seconds)},
                            {"peak_memory_mib", number(facts.peak_memory_mib)},
                            {"device", facts.device},
                            {"motion", facts.motion},
                            {"resolution", config.scene.resolution},
                            {"background", name_of(config.scene.background)},
                            {"seed", config.train.seed}};
  write_text(of_all, json_text(results, 1) + "\n");
  return {of_all, of_each};
}

MetricsOptions RunFolder::judged_by() const {
  const std::string text = read_report_or_empty(path("results.json"));
  const OrderedJson results = parse_json_within_limits(text);
  const auto test = results.is_object() ? results.value("test", OrderedJson()) : OrderedJson();
  const auto named = [&](const char* key) {
    return test.is_object() && test.contains(key) && test[key].is_string()
               ? test[key].get<std::string>()
               : "";
  };
  return {named("lpips_model"), named("clip_model")};
}

void RunFolder::write_facts(const RunFacts& facts) const {
  const OrderedJson run{{"iterations", facts.iterations},
                        {"train_seconds", facts.train_seconds},
                        {"peak_memory_mib", facts.peak_memory_mib},
                        {"device", facts.device},
                        {"motion", facts.motion},
                        {"finished", facts.finished}};
  write_text(path("training.json"), json_text(run, 1) + "\n");
}

RunFacts RunFolder::read_facts() const {
  RunFacts facts;
  std::string why = path("training.json") + " is damaged or was not written by `gflow train`";
  try {
    const std::string text = read_report_or_empty(path("training.json"));
    if (text.empty() && !fs::exists(path("training.json"))) return facts;
    const OrderedJson run = parse_json_within_limits(text);
    const OrderedJson& iterations = run.at("iterations");
    facts.iterations = iterations.is_number_integer() ? iterations.get<int>() : -1;
    facts.train_seconds = run.value("train_seconds", 0.0);
    facts.peak_memory_mib = run.value("peak_memory_mib", 0.0);
    facts.device = run.value("device", "");
    facts.motion = run.value("motion", "");
    facts.finished = run.value("finished", false);
    if (facts.iterations >= 0) return facts;
  } catch (const OrderedJson::exception&) {
  } catch (const Error& problem) {
    // An unreadable file is not a missing one: the run would be absent from a table, or trained
    // again.
    if (fs::is_regular_file(path("training.json"))) throw;
    why = problem.what();
  }
  static std::set<std::string> told;
  if (told.insert(folder_).second) warn(why + ": time and memory of the run are unknown");
  return {};
}

}  // namespace gflow
