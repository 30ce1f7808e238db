// SPDX-License-Identifier: Apache-2.0
#include "apps/report/experiment_report.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "apps/experiments/runs.hpp"
#include "apps/report/html.hpp"
#include "apps/report/log.hpp"
#include "optim/images/image.hpp"
#include "runtime/base/interrupt.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow::report {
namespace {

using experiments::Better;
using experiments::Metric;
using experiments::Plan;
using experiments::Results;
using experiments::Table;

constexpr int kWidestSheet = 1600;               // [px]
constexpr size_t kMostSheets = size_t{6} << 20;  // [bytes] of all sheets, as text
constexpr size_t kMostCurvePoints = 150;

std::string html_of(const Table::Entry& entry) {
  std::string html = escaped(entry.value);
  if (entry.best) html = "<b>" + html + "</b>";
  if (!entry.spread.empty()) html += " <small>± " + escaped(entry.spread) + "</small>";
  if (!entry.difference.empty()) html += " <small>(" + escaped(entry.difference) + ")</small>";
  return html;
}

std::string html_of(const Table& given, const std::string& caption) {
  if (given.rows.empty()) return "";
  const size_t names = given.rows.front().names.size();
  std::vector<TableCell> head;
  for (const std::string& name : given.head)
    head.push_back({escaped(name), false, head.size() < names});
  std::vector<std::vector<TableCell>> rows;
  for (const Table::Row& row : given.rows) {
    std::vector<TableCell> cells;
    for (const std::string& name : row.names) cells.push_back({escaped(name), false, true});
    for (const Table::Entry& entry : row.entries) cells.push_back({html_of(entry), false, false});
    rows.push_back(std::move(cells));
  }
  return table(caption, head, rows);
}

std::string experiment_heading(const ExperimentReport& report) {
  std::vector<std::string> axes;
  for (const std::string& axis : report.axes) axes.push_back("<b>" + escaped(axis) + "</b>");
  return fmt::format(
      "<header>\n{}<h1>{}</h1>\n<p class=\"lead\">{} on {}{}.</p>\n<p class=\"lead\">{}</p>\n"
      "</header>\n",
      brand("report of an experiment", report.date), escaped(report.title),
      counted(report.runs, "training", "trainings"), counted(report.scenes, "scene", "scenes"),
      axes.empty() ? "" : fmt::format(", compared by {}", fmt::join(axes, ", ")),
      escaped(report.summary));
}

std::string charts(const std::vector<std::string>& figures) {
  const std::string html = fmt::format("{}", fmt::join(figures, ""));
  return html.empty() ? "" : "<div class=\"charts\">\n" + html + "</div>\n";
}

std::string curves_html(const std::vector<SceneCurves>& scenes) {
  std::vector<std::string> figures;
  for (const SceneCurves& scene : scenes) {
    LineChart chart;
    chart.title = scene.scene;
    chart.unit = "dB";
    chart.x_name = "step";
    chart.series = scene.series;
    figures.push_back(line_chart(chart));
  }
  return charts(figures);
}

// Names of a row of Results::json() without the scene, and its scene.
struct RowNames {
  std::string scene, choices;
};
RowNames names_of(const nlohmann::ordered_json& row, const Plan& plan) {
  std::vector<std::string> choices;
  for (const std::string& axis : plan.axes) choices.push_back(row.at(axis).get<std::string>());
  return {row.at("scene").get<std::string>(), fmt::format("{}", fmt::join(choices, ", "))};
}

double value_or_nan(const nlohmann::ordered_json& value) {
  return value.is_number() ? value.get<double>() : std::nan("");
}

// Where bars begin: at 0 if lower is better; else a fifth of the range below the lowest, because
// from 0 all would look alike.
double start_of(const std::vector<Bar>& bars, Better better) {
  double low = HUGE_VAL, high = -HUGE_VAL;
  for (const Bar& bar : bars)
    if (std::isfinite(bar.value)) low = std::min(low, bar.value), high = std::max(high, bar.value);
  if (better == Better::lower || !(high >= low)) return 0;
  const double step = std::max(0.2 * (high - low), 1e-3 * std::fabs(low));
  return low - step;
}

std::vector<BarChart> bars_of(const Plan& plan, const Results& results) {
  const nlohmann::ordered_json rows = results.json().at("rows");
  const bool several = std::any_of(rows.begin(), rows.end(), [&](const auto& row) {
    return row.at("scene") != rows.front().at("scene");
  });
  std::vector<BarChart> charts;
  for (const Metric& metric : results.metrics()) {
    if (metric.better == Better::neither) continue;
    BarChart chart;
    chart.title = metric.label;
    chart.digits = metric.digits;
    size_t color = 0;
    std::string scene;
    for (const auto& row : rows) {
      const RowNames names = names_of(row, plan);
      color = names.scene == scene ? color + 1 : 0;  // the same choices, the same colour
      scene = names.scene;
      const auto& cell = row.at("metrics").at(metric.name);
      std::string name = names.choices.empty() ? names.scene : names.choices;
      if (several && !names.choices.empty()) name = names.scene + ": " + name;
      chart.bars.push_back(
          {name, value_or_nan(cell.at("mean")), value_or_nan(cell.at("std")), color});
    }
    chart.start = start_of(chart.bars, metric.better);
    charts.push_back(std::move(chart));
  }
  return charts;
}

std::vector<SceneCurves> curves_of(const Plan& plan, const std::string& folder) {
  std::vector<SceneCurves> scenes;
  for (size_t i = 0; i < plan.runs.size(); ++i) {
    const experiments::Row& row = plan.rows[plan.runs[i].row];
    if (!is_first_seed(plan, i)) continue;
    const Points points =
        curve_of(read_log(experiments::RunFiles(folder, plan.runs[i].id).run), "psnr");
    if (points.empty()) continue;
    if (scenes.empty() || scenes.back().scene != row.scene) scenes.push_back({row.scene, {}});
    std::vector<Series>& series = scenes.back().series;
    series.push_back({name_of(row, plan.title), thinned(smoothed(points), kMostCurvePoints),
                      series.size(), false});
  }
  return scenes;
}

std::string baseline_of(const Plan& plan) {
  std::vector<std::string> words;
  for (size_t k = 0; k < plan.baseline.size(); ++k)
    if (plan.baseline[k] != experiments::any_choice)
      words.push_back(fmt::format("{} = {}", plan.axes[k], plan.baseline[k]));
  return fmt::format("{}", fmt::join(words, ", "));
}

ExperimentReport gathered_experiment(const Plan& plan, const Results& results,
                                     const std::string& folder,
                                     const std::vector<std::string>& sheets,
                                     const std::string& version) {
  ExperimentReport report;
  report.title = plan.title;
  report.date = today();
  report.version = version;
  report.summary = results.summary();
  report.axes = plan.axes;
  std::vector<std::string> scenes;
  for (const experiments::Row& row : plan.rows) scenes.push_back(row.scene);
  report.scenes = size_t(std::unique(scenes.begin(), scenes.end()) - scenes.begin());
  report.runs = plan.runs.size();
  report.baseline = baseline_of(plan);
  report.table = results.table();
  report.costs = results.cost_table();
  report.bars = bars_of(plan, results);
  report.curves = curves_of(plan, folder);
  size_t bytes = 0;
  for (const std::string& path : sheets) {
    Picture picture = picture_of(read_image(path), kWidestSheet);
    bytes += picture.address.size();
    if (bytes > kMostSheets) break;
    report.sheets.push_back({std::filesystem::path(path).stem().string(), std::move(picture)});
  }
  return report;
}

}  // namespace

std::string experiment_report_html(const ExperimentReport& report) {
  std::string html = experiment_heading(report);
  html += section("Results",
                  "Bold: the best of the rows that are compared with each other." +
                      (report.baseline.empty()
                           ? ""
                           : " In brackets: the difference to " + escaped(report.baseline) + "."),
                  html_of(report.table, "Results"));
  std::vector<std::string> bars;
  for (const BarChart& chart : report.bars) bars.push_back(bar_chart(chart));
  if (const std::string figures = charts(bars); !figures.empty())
    html += section("Bars", "Means; lines across are the standard deviation over seeds.", figures);
  if (const std::string figures = curves_html(report.curves); !figures.empty())
    html += section("Training",
                    "PSNR of the training images over the steps, as a local mean, of the first "
                    "seed; at the end of a name its last value.",
                    figures);
  std::string sheets;
  for (const Sheet& sheet : report.sheets)
    sheets += fmt::format("<figure class=\"sheet\"><figcaption>{}</figcaption>{}</figure>\n",
                          escaped(sheet.name), img(sheet.picture, "Contact sheet " + sheet.name));
  if (!sheets.empty())
    html += section("Pictures",
                    "A test view of the first seed of each row, from left to right: image, render, "
                    "error × 4, and flow of the model and target flow where there is flow.",
                    sheets);
  html += section("Costs", "", html_of(report.costs, "Costs"));
  html += fmt::format("<footer>Written by gflow {}.</footer>\n", escaped(report.version));
  return page(report.title + ", report of gflow", html);
}

std::string write_experiment_report(const Plan& plan, const Results& results,
                                    const std::string& folder,
                                    const std::vector<std::string>& sheets,
                                    const std::string& version) {
  const std::string path = folder + "/report.html";
  try {
    write_file_atomically(
        path, experiment_report_html(gathered_experiment(plan, results, folder, sheets, version)));
    return path;
  } catch (const Interrupted&) {
    throw;
  } catch (const std::exception& problem) {
    warn(fmt::format("{} not written: {}; the tables are complete", path, problem.what()));
    return "";
  }
}

}  // namespace gflow::report
