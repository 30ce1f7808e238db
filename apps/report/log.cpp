// SPDX-License-Identifier: Apache-2.0
#include "apps/report/log.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "optim/runs/run_folder.hpp"
#include "runtime/files/text_file.hpp"

namespace gflow::report {
namespace {

constexpr size_t kMostPoints = 300;

// Adds a value as a smooth line over a faint one, if the log has it.
void add_curve(LineChart& chart, const std::vector<LogLine>& log, const std::string& value,
               const std::string& name, bool smooth = true) {
  const Points points = curve_of(log, value);
  if (points.empty()) return;
  const size_t color = size_t(std::count_if(chart.series.begin(), chart.series.end(),
                                            [](const Series& series) { return !series.faint; }));
  smooth &= is_smoothed(log);
  if (smooth) chart.series.push_back({"", points, color, true});
  chart.series.push_back({name, smooth ? smoothed(points) : points, color, false});
}

// Whether a value is anything but zero in some line.
bool is_used(const std::vector<LogLine>& log, const std::string& value) {
  const Points points = curve_of(log, value);
  return std::any_of(points.begin(), points.end(),
                     [](const auto& point) { return point.second != 0; });
}

LineChart chart_of(const char* title, const char* unit, int digits) {
  LineChart chart;
  chart.title = title;
  chart.unit = unit;
  chart.x_name = "step";
  chart.digits = digits;
  return chart;
}

}  // namespace

std::vector<LogLine> read_log(const std::string& run_folder) {
  const std::string text = read_text_or_empty(run_folder + "/metrics.jsonl");
  std::vector<LogLine> log;
  for (std::string_view rest = text; !rest.empty();) {
    const nlohmann::ordered_json line = RunFolder::metrics_of(take_line(rest));
    if (!line.is_object()) continue;
    LogLine read{line["iteration"].get<double>(), {}};
    for (const auto& [name, value] : line.items())
      if (value.is_number() && name != "iteration") read.values[name] = value.get<double>();
    log.push_back(std::move(read));
  }
  return log;
}

Points curve_of(const std::vector<LogLine>& log, const std::string& name) {
  Points points;
  for (const LogLine& line : log)
    if (const auto found = line.values.find(name); found != line.values.end())
      points.emplace_back(line.step, found->second);
  return thinned(points, kMostPoints);
}

bool is_smoothed(const std::vector<LogLine>& log) { return log.size() >= kFewestSmoothed; }

std::string training_charts(const std::vector<LogLine>& log) {
  LineChart loss = chart_of("Loss", "logarithmic, lower is better", 4);
  loss.log = true;
  add_curve(loss, log, "loss", "all terms");
  add_curve(loss, log, "l1", "image, L1");
  if (is_used(log, "flow_loss")) add_curve(loss, log, "flow_loss", "flow");
  LineChart psnr = chart_of("PSNR", "dB, higher is better", 1);
  add_curve(psnr, log, "psnr", "the step's training image");
  add_curve(psnr, log, "val_psnr", "held-back views", false);
  add_curve(psnr, log, "val_psnr_train", "training views", false);
  LineChart flow = chart_of("Flow error, all pixels", "px, lower is better", 2);
  flow.from_zero = true;
  if (is_used(log, "flow_epe")) add_curve(flow, log, "flow_epe", "to target flow");
  LineChart gaussians = chart_of("Gaussians", "number", 0);
  gaussians.from_zero = true;
  add_curve(gaussians, log, "num_gaussians", "all", false);
  if (curve_of(log, "num_moving") != curve_of(log, "num_gaussians"))
    add_curve(gaussians, log, "num_moving", "dynamic", false);
  // Terms that only some trainings have, the most important first as they are logged.
  static const std::set<std::string> shown{
      "loss",      "l1",       "ssim",     "psnr",    "seconds",        "flow_epe",
      "flow_loss", "val_psnr", "rejected", "refused", "val_psnr_train", "num_gaussians",
      "num_moving"};
  std::set<std::string> others;
  for (const LogLine& line : log)
    for (const auto& entry : line.values)
      if (!shown.count(entry.first)) others.insert(entry.first);
  LineChart more = chart_of("Other terms", "logarithmic", 4);
  more.log = true;
  for (const std::string& name : others)
    if (is_used(log, name) && more.series.size() < 8) add_curve(more, log, name, name);
  std::string html;
  for (const LineChart& chart : {loss, psnr, flow, gaussians, more}) html += line_chart(chart);
  return html.empty() ? "" : "<div class=\"charts row\">\n" + html + "</div>\n";
}

}  // namespace gflow::report
