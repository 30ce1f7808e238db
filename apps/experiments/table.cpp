// SPDX-License-Identifier: Apache-2.0
#include "apps/experiments/table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <set>

#include "apps/experiments/runs.hpp"
#include "optim/runs/run_folder.hpp"
#include "optim/scene/json_file.hpp"
#include "runtime/files/text_file.hpp"

namespace gflow::experiments {
namespace {

using Words = std::vector<std::string>;

// Scene name of the rows of means.
const char* const all_scenes = "all scenes";

std::string digits(double value, int behind_the_point) {
  return std::isnan(value) ? "-" : fmt::format("{:.{}f}", value, behind_the_point);
}

std::string csv_line(const Words& words) {
  Words quoted;
  for (const std::string& word : words) {
    const bool plain = word.find_first_of(",\"\n") == std::string::npos;
    std::string text = plain ? word : "\"";
    for (size_t i = 0; !plain && i < word.size(); ++i)
      text += word[i] == '"' ? "\"\"" : word.substr(i, 1);
    quoted.push_back(plain ? text : text + "\"");
  }
  return fmt::format("{}\n", fmt::join(quoted, ","));
}

// Text of a cell without a value.
const char* const no_model = "no model given";

std::string csv_number(double value) { return std::isnan(value) ? "" : fmt::format("{}", value); }

std::string markdown_line(const Words& words) {
  std::string line = "|";
  for (const std::string& word : words) {
    line += ' ';
    for (const char c : word) {
      if (c == '|') line += '\\';
      line += c == '\n' ? ' ' : c;
    }
    line += " |";
  }
  return line + "\n";
}

std::string markdown_of(const Table& table) {
  std::string text = markdown_line(table.head) + markdown_line(Words(table.head.size(), "---"));
  for (const Table::Row& row : table.rows) {
    Words words = row.names;
    for (const Table::Entry& entry : row.entries) {
      std::string word = entry.best ? "**" + entry.value + "**" : entry.value;
      if (!entry.spread.empty()) word += " ± " + entry.spread;
      if (!entry.difference.empty()) word += " (" + entry.difference + ")";
      words.push_back(word);
    }
    text += markdown_line(words);
  }
  return text;
}

// Quotes a text for a gnuplot script.
std::string quoted(const std::string& text) {
  std::string safe = "'";
  for (const char c : text) {
    if (c == '\'') safe += c;
    safe += c == '\n' ? ' ' : c;
  }
  return safe + "'";
}

// A text for a table that gnuplot reads, where tabs separate cells and quotation marks join them.
std::string plain(std::string text) {
  for (char& c : text)
    if (c == '\t' || c == '\n' || c == '"') c = ' ';
  return text;
}

Words scenes_of(const Plan& plan) {
  Words scenes;
  for (const Row& row : plan.rows)
    if (std::find(scenes.begin(), scenes.end(), row.scene) == scenes.end())
      scenes.push_back(row.scene);
  return scenes;
}

// Colour of bar k of `count` as #RRGGBB: hues around the circle, every other one darker.
std::string colour(size_t k, size_t count) {
  const double hue = 6 * double(k) / double(count), value = k % 2 ? 150 : 220;
  const auto level = [&](double at) {  // 1 within 60 degrees of its hue, 0 from 120 on
    const double away = std::fabs(std::remainder(hue - at, 6));
    return int(value * (0.15 + 0.85 * std::clamp(2 - away, 0.0, 1.0)));
  };
  return fmt::format("#{:02x}{:02x}{:02x}", level(0), level(2), level(4));
}

// Lower end of the bar axis: 0 where lower is better. For PSNR and SSIM a fifth of their range
// below the minimum, because from 0 all bars would look alike.
template <class Line>
double lowest(const std::vector<Line>& lines, Better better) {
  if (better == Better::lower) return 0;
  double least = HUGE_VAL, most = -HUGE_VAL;
  for (const Line& line : lines) {
    const double mean = line.cells[0].mean();
    if (std::isnan(mean)) continue;
    least = std::min(least, mean);
    most = std::max(most, mean);
  }
  return least - std::max(0.2 * (most - least), 1e-3 * std::fabs(least));
}

bool is_baseline(const Plan& plan, const Row& row) {
  bool is = !plan.baseline.empty();
  for (size_t k = 0; k < plan.baseline.size(); ++k)
    is &= plan.baseline[k] == any_choice || plan.baseline[k] == row.choices[k];
  return is;
}

// Whether two rows share the scene and the choice of each axis that the baseline leaves open.
bool are_compared(const Plan& plan, const Row& a, const Row& b) {
  bool are = a.scene == b.scene;
  for (size_t k = 0; k < plan.baseline.size(); ++k)
    are &= plan.baseline[k] != any_choice || a.choices[k] == b.choices[k];
  return are;
}

}  // namespace

std::vector<nlohmann::json> results_of(const Plan& plan, const std::string& folder) {
  std::vector<nlohmann::json> results;
  for (const PlannedRun& run : plan.runs) {
    results.emplace_back();
    if (standing_of(run, folder).status == Status::finished)
      results.back() = read_json(RunFiles(folder, run.id).run + "/results.json");
  }
  return results;
}

double Cell::mean() const {
  if (values.empty()) return std::nan("");
  return std::accumulate(values.begin(), values.end(), 0.0) / double(values.size());
}

double Cell::spread() const {
  if (values.size() < 2) return std::nan("");
  double squares = 0;
  for (const double value : values) squares += (value - mean()) * (value - mean());
  return std::sqrt(squares / double(values.size() - 1));
}

Results::Results(const Plan& plan, std::vector<nlohmann::json> results)
    : plan_(plan), results_(std::move(results)) {
  for (const Metric& metric : all_metrics()) {
    const auto& asked = plan.metrics;
    // A metric without a network keeps its column, so that the gap is visible.
    const bool known = std::any_of(results_.begin(), results_.end(), [&](const nlohmann::json& r) {
      return !std::isnan(value_of(metric, r)) || lacks_model(metric, r);
    });
    const bool wanted = asked.empty()
                            ? known && is_repeatable(metric) && metric.better != Better::neither
                            : std::find(asked.begin(), asked.end(), metric.name) != asked.end();
    if (wanted) metrics_.push_back(metric);
  }
  for (const std::string& name : plan.metrics)
    if (const Metric metric = metric_named(name); metric.steps) metrics_.push_back(metric);
}

std::vector<Results::Line> Results::lines_of(const std::vector<Metric>& metrics) const {
  std::vector<Line> lines;
  for (size_t r = 0; r < plan_.rows.size(); ++r) {
    Line line{plan_.rows[r], std::vector<Cell>(metrics.size())};
    for (size_t i = 0; i < plan_.runs.size(); ++i) {
      if (plan_.runs[i].row != r) continue;
      for (size_t m = 0; m < metrics.size(); ++m) {
        const double value = value_of(metrics[m], results_[i]);
        if (!std::isnan(value)) line.cells[m].values.push_back(value);
        line.cells[m].no_model |= lacks_model(metrics[m], results_[i]);
      }
    }
    for (Cell& cell : line.cells) cell.no_model &= cell.values.empty();
    lines.push_back(line);
  }
  const size_t scenes = scenes_of(plan_).size(), each = lines.size() / scenes;
  if (scenes < 2) return lines;
  for (size_t k = 0; k < each; ++k) {
    Line mean{{all_scenes, lines[k].row.choices}, std::vector<Cell>(metrics.size())};
    for (size_t m = 0; m < metrics.size(); ++m) {
      std::map<int64_t, std::vector<double>> by_seed;  // one value per scene
      for (size_t i = 0; i < plan_.runs.size(); ++i) {
        const double value = value_of(metrics[m], results_[i]);
        if (plan_.runs[i].row % each == k && !std::isnan(value))
          by_seed[plan_.runs[i].config.train.seed].push_back(value);
      }
      // Only seeds that all scenes have: other means could not be compared.
      for (const auto& [seed, values] : by_seed)
        if (values.size() == scenes) mean.cells[m].values.push_back(Cell{values}.mean());
      for (size_t s = 0; s < scenes; ++s)
        mean.cells[m].no_model |= lines[s * each + k].cells[m].no_model;
    }
    lines.push_back(mean);
  }
  return lines;
}

Table Results::table_of(const std::vector<Metric>& metrics, bool marks) const {
  const std::vector<Line> lines = lines_of(metrics);
  Table table;
  table.head = {"scene"};
  table.head.insert(table.head.end(), plan_.axes.begin(), plan_.axes.end());
  for (const Metric& metric : metrics) table.head.push_back(metric.label);
  for (const Line& line : lines) {
    Table::Row row{{line.row.scene}, {}};
    row.names.insert(row.names.end(), line.row.choices.begin(), line.row.choices.end());
    for (size_t m = 0; m < metrics.size(); ++m) {
      const Metric& metric = metrics[m];
      const Cell& cell = line.cells[m];
      const double mean = cell.mean();
      double best = mean, base = std::nan("");
      int others = 0;
      for (const Line& other : lines) {
        const double value = other.cells[m].mean();
        if (!are_compared(plan_, other.row, line.row) || std::isnan(value)) continue;
        ++others;
        best = metric.better == Better::lower ? std::min(best, value) : std::max(best, value);
        if (is_baseline(plan_, other.row)) base = value;
      }
      Table::Entry entry;
      entry.value = cell.no_model ? no_model : digits(mean, metric.digits);
      entry.best = marks && others > 1 && mean == best && metric.better != Better::neither;
      if (cell.values.size() > 1) entry.spread = digits(cell.spread(), metric.digits);
      if (marks && metric.better != Better::neither && !is_baseline(plan_, line.row) &&
          !std::isnan(base - mean))
        entry.difference = fmt::format("{:+.{}f}", mean - base, metric.digits);
      row.entries.push_back(std::move(entry));
    }
    table.rows.push_back(std::move(row));
  }
  return table;
}

std::string Results::summary() const {
  size_t finished = 0;
  std::set<std::string> devices;
  for (const nlohmann::json& result : results_) {
    finished += result.is_object();
    if (result.is_object()) devices.insert(member_or(result, "device", std::string()));
  }
  std::set<std::string> seen;  // scenes
  for (size_t i = 0; i < results_.size(); ++i)
    if (results_[i].is_object() && results_[i].contains("test") &&
        member_or(results_[i]["test"], "trained_on", false))
      seen.insert(plan_.rows[plan_.runs[i].row].scene);
  return fmt::format(
      "{} of {} runs{}. Means{}.{}", finished, plan_.runs.size(),
      devices.empty() ? "" : fmt::format(", on {}", fmt::join(devices, " and ")),
      plan_.runs.size() > plan_.rows.size() ? " ± standard deviation over seeds" : " of one seed",
      seen.empty()
          ? ""
          : fmt::format(" The test views of {} were used for training: they are not novel views.",
                        fmt::join(seen, ", ")));
}

std::string Results::markdown() const {
  return fmt::format("# {}\n\n{}\n\n{}", plan_.title, summary(), markdown_of(table()));
}

Table Results::cost_table() const {
  return table_of({metric_named("minutes"), metric_named("memory"), metric_named("gaussians"),
                   metric_named("steps")},
                  false);
}

std::string Results::costs() const { return markdown_of(cost_table()); }

std::string Results::csv() const {
  Words head{"scene"};
  head.insert(head.end(), plan_.axes.begin(), plan_.axes.end());
  head.push_back("seeds");
  for (const Metric& metric : metrics_)
    for (const char* what : {"", "_std"}) head.push_back(metric.name + what);
  std::string text = csv_line(head);
  for (const Line& line : lines_of(metrics_)) {
    Words words{line.row.scene};
    words.insert(words.end(), line.row.choices.begin(), line.row.choices.end());
    size_t seeds = 0;
    for (const Cell& cell : line.cells) seeds = std::max(seeds, cell.values.size());
    words.push_back(fmt::format("{}", seeds));
    for (const Cell& cell : line.cells) {
      words.push_back(cell.no_model ? no_model : csv_number(cell.mean()));
      words.push_back(csv_number(cell.spread()));
    }
    text += csv_line(words);
  }
  return text;
}

std::string Results::runs_csv() const {
  Words head{"run", "scene"};
  head.insert(head.end(), plan_.axes.begin(), plan_.axes.end());
  head.push_back("seed");
  for (const Metric& metric : all_metrics()) head.push_back(metric.name);
  std::string text = csv_line(head);
  for (size_t i = 0; i < plan_.runs.size(); ++i) {
    if (!results_[i].is_object()) continue;
    const Row& row = plan_.rows[plan_.runs[i].row];
    Words words{plan_.runs[i].id, row.scene};
    words.insert(words.end(), row.choices.begin(), row.choices.end());
    words.push_back(fmt::format("{}", plan_.runs[i].config.train.seed));
    for (const Metric& metric : all_metrics())
      words.push_back(lacks_model(metric, results_[i]) ? no_model
                                                       : csv_number(value_of(metric, results_[i])));
    text += csv_line(words);
  }
  return text;
}

nlohmann::ordered_json Results::json() const {
  const auto or_null = [](double value) {
    return std::isnan(value) ? nlohmann::ordered_json() : nlohmann::ordered_json(value);
  };
  nlohmann::ordered_json all{{"title", plan_.title}, {"rows", nlohmann::ordered_json::array()}};
  for (const Line& line : lines_of(metrics_)) {
    nlohmann::ordered_json row{{"scene", line.row.scene}};
    for (size_t a = 0; a < plan_.axes.size(); ++a) row[plan_.axes[a]] = line.row.choices[a];
    for (size_t m = 0; m < metrics_.size(); ++m)
      row["metrics"][metrics_[m].name] = {{"mean", or_null(line.cells[m].mean())},
                                          {"std", or_null(line.cells[m].spread())},
                                          {"values", line.cells[m].values},
                                          {"no_model", line.cells[m].no_model}};
    all["rows"].push_back(row);
  }
  return all;
}

std::vector<Plot> Results::bars() const {
  const Words scenes = scenes_of(plan_);
  const size_t each = plan_.rows.size() / scenes.size();
  std::vector<Plot> plots;
  for (size_t m = 0; m < metrics_.size(); ++m) {
    if (metrics_[m].better == Better::neither) continue;
    const std::vector<Line> lines = lines_of({metrics_[m]});
    if (std::all_of(lines.begin(), lines.end(),
                    [](const Line& line) { return line.cells[0].values.empty(); }))
      continue;
    Plot plot;
    plot.name = file_name(metrics_[m].name);
    Words head{"scene"};
    for (size_t k = 0; k < each; ++k) {
      head.push_back(plain(name_of(plan_.rows[k], plan_.title)));
      head.push_back("std");
    }
    plot.table = {head};
    for (size_t s = 0; s < scenes.size(); ++s) {
      Words words{plain(scenes[s])};
      for (size_t k = 0; k < each; ++k) {
        const Cell& cell = lines[s * each + k].cells[0];
        const double spread = cell.spread();
        words.push_back(std::isnan(cell.mean()) ? "?" : fmt::format("{}", cell.mean()));
        words.push_back(fmt::format("{}", std::isnan(spread) ? 0 : spread));
      }
      plot.table.push_back(words);
    }
    Words series;
    for (size_t k = 0; k < each; ++k)
      series.push_back(
          fmt::format("'{}.tsv' using {}:{}:xtic(1) title columnheader({}) lc rgb '{}'", plot.name,
                      2 * k + 2, 2 * k + 3, 2 * k + 2, colour(k, each)));
    plot.height += int(20 * each);  // space for the names
    plot.script = fmt::format(
        "set termoption noenhanced\nset datafile missing '?'\nset style data histograms\n"
        "set style histogram errorbars gap 2 lw 1\nset style fill solid 0.8\n"
        "set key outside below left Left reverse maxcols 1\nset ylabel {}\nset yrange [{}:*]\n"
        "plot {}",
        quoted(metrics_[m].label), lowest(lines, metrics_[m].better), fmt::join(series, ", "));
    plots.push_back(plot);
  }
  return plots;
}

std::vector<Plot> Results::curves(const std::string& folder) const {
  const Words scenes = scenes_of(plan_);
  std::vector<Plot> plots;
  for (const std::string& scene : scenes)
    for (const bool by_time : {false, true}) {
      Plot plot;
      plot.name = fmt::format("curve_{}_{}", scene, by_time ? "seconds" : "steps");
      plot.name = file_name(plot.name);
      std::string lines;
      int block = 0;
      for (size_t i = 0; i < plan_.runs.size(); ++i) {
        const Row& row = plan_.rows[plan_.runs[i].row];
        if (row.scene != scene || !is_first_seed(plan_, i) || !results_[i].is_object()) continue;
        const std::string metrics =
            read_text_or_empty(RunFiles(folder, plan_.runs[i].id).run + "/metrics.jsonl");
        if (block > 0) plot.table.insert(plot.table.end(), 2, Words{});
        plot.table.push_back({by_time ? "seconds" : "steps", plain(name_of(row, plan_.title))});
        for (std::string_view rest = metrics; !rest.empty();) {
          const nlohmann::json step = RunFolder::metrics_of(take_line(rest));
          if (step.is_object())
            plot.table.push_back(
                {fmt::format("{}", member_or(step, by_time ? "seconds" : "iteration", 0.0)),
                 fmt::format("{}", member_or(step, "psnr", std::nan("")))});
        }
        lines +=
            fmt::format("{}'{}.tsv' index {} using 1:2 with lines lw 1.5 title columnheader(2)",
                        block > 0 ? ", " : "", plot.name, block);
        ++block;
      }
      if (block == 0) continue;
      plot.script = fmt::format(
          "set termoption noenhanced\nset title {}\nset xlabel '{}'\n"
          "set ylabel 'PSNR of the training images [dB]'\nplot {}",
          quoted(scene), by_time ? "seconds of training" : "steps", lines);
      plots.push_back(plot);
    }
  return plots;
}

}  // namespace gflow::experiments
