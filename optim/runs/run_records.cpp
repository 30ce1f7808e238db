// SPDX-License-Identifier: Apache-2.0
// What a run records of itself: log, results and facts.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "optim/runs/run_folder.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/json_text.hpp"
#include "runtime/files/modest_json.hpp"
#include "runtime/files/text_file.hpp"

namespace gflow {

namespace fs = std::filesystem;
using OrderedJson = nlohmann::ordered_json;

namespace {

// Appends lines to a file, or replaces its contents. Undone on failure.
void append_lines(const std::string& file, bool replace, const std::string& lines) {
  std::error_code none;
  const uintmax_t before = !replace && fs::exists(file) ? fs::file_size(file, none) : 0;
  std::ofstream out(file, replace ? std::ios::trunc : std::ios::app);
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
  OrderedJson metrics;
  for (const auto& [name, value] : view_metrics()) metrics[name] = number(view.*value);
  return metrics;
}

// Mean of each metric over the views of each time step.
OrderedJson metrics_by_step(const std::vector<ViewMetrics>& views) {
  int steps = 0;
  for (const ViewMetrics& view : views) steps = std::max(steps, view.step + 1);
  OrderedJson all = OrderedJson::object();
  for (const auto& [name, value] : view_metrics()) {
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

}  // namespace

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
    if (*text != read_text_or_empty(path(name))) write_file_atomically(path(name), *text);
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
  for (const ViewMetrics& view : evaluation.views) {
    views[view.name] = {{"time", view.time}};
    views[view.name].update(metrics_of_view(view));
  }
  write_file_atomically(of_each, json_text(views, 1) + "\n");
  OrderedJson test = metrics_of_view(evaluation.mean);
  test["by_step"] = metrics_by_step(evaluation.views);
  test["flow_reference"] = evaluation.flow_reference;
  test["views"] = evaluation.views.size();
  test["trained_on"] = evaluation.trained_on;
  test["fitted_cameras"] = evaluation.fitted_cameras;
  test["lpips_model"] = network(evaluation.lpips_model);
  test["clip_model"] = network(evaluation.clip_model);
  if (const auto& tracks = evaluation.tracks)
    test["tracks"] = {{"mean", tracks->mean},     {"median", tracks->median},
                      {"end", tracks->end},       {"by_step", tracks->by_step},
                      {"motion", tracks->motion}, {"motion_by_step", tracks->motion_by_step},
                      {"still", tracks->still},   {"lost", tracks->lost}};
  if (const auto& tracks = evaluation.tracks; tracks && tracks->from_view)
    test["tracks"]["from_view"] = *tracks->from_view;
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
  write_file_atomically(of_all, json_text(results, 1) + "\n");
  return {of_all, of_each};
}

MetricsOptions RunFolder::metrics_options() const {
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
  write_file_atomically(path("training.json"), json_text(run, 1) + "\n");
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
