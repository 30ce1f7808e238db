// SPDX-License-Identifier: Apache-2.0
#include "apps/report/run_metrics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "apps/report/html.hpp"

namespace gflow::report {

const std::vector<ShownMetric>& shown_metrics() {
  static const std::vector<ShownMetric> metrics{
      {&ViewMetrics::psnr, "PSNR", "dB", 2, 1, true,
       "closeness of all pixels; above 30 dB differences are hard to see"},
      {&ViewMetrics::psnr_unfitted, "PSNR before cameras were fitted", "dB", 2, 1, true,
       "with the camera poses as they were found"},
      {&ViewMetrics::psnr_matched, "PSNR, colours matched", "dB", 2, 1, true,
       "after exposure and white balance of the render were matched to the photograph"},
      {&ViewMetrics::psnr_dynamic, "PSNR, moving", "dB", 2, 1, true,
       "of pixels that move by more than 1 px to the next image"},
      {&ViewMetrics::ssim, "SSIM", "", 4, 1, true, "similarity of structure, at most 1"},
      {&ViewMetrics::ssim_dynamic, "SSIM, moving", "", 4, 1, true, "of moving pixels"},
      {&ViewMetrics::lpips, "LPIPS", "", 4, 1, false, "perceived difference by a network, 0: none"},
      {&ViewMetrics::clip, "CLIP", "", 4, 1, true, "similarity of content by a network, at most 1"},
      {&ViewMetrics::flow_epe, "Flow error, all pixels", "px", 3, 1, false,
       "distance between the end points of rendered and reference flow"},
      {&ViewMetrics::flow_epe_dynamic, "Flow error, moving", "px", 3, 1, false, "of moving pixels"},
      {&ViewMetrics::teacher_epe_dynamic, "Flow error of DIS, moving", "px", 3, 1, false,
       "of the optical flow that training can compute, at the same pixels"},
      {&ViewMetrics::fl_all, "Fl-all", "%", 2, 100, false,
       "pixels whose flow is off by more than 3 px and 5 %"},
      {&ViewMetrics::depth_error, "Depth error", "%", 2, 100, false, "relative to the true depth"},
      {&ViewMetrics::flicker, "Flicker", "grey levels", 2, 1, false,
       "change of the error from one image to the next"}};
  return metrics;
}

std::string with_unit(const ShownMetric& metric, double value) {
  std::string text = number(value * metric.scale, metric.digits);
  if (metric.unit[0] && std::isfinite(value)) text += fmt::format(" {}", metric.unit);
  return text;
}

std::string split_in_words(const std::string& split) {
  return split == "train" ? "training" : split == "val" ? "validation" : split;
}

namespace {

std::string tile(const std::string& name, const std::string& value, const std::string& unit,
                 const std::string& of) {
  return fmt::format("<div><dt>{}</dt><dd>{}{}</dd><dd class=\"of\">{}</dd></div>\n", name, value,
                     unit.empty() ? "" : " <span>" + unit + "</span>", of);
}

}  // namespace

std::string tiles(const RunReport& report) {
  const std::string of =
      counted(report.evaluation.views.size(), (split_in_words(report.split) + " view").c_str(),
              (split_in_words(report.split) + " views").c_str());
  std::string html;
  for (const ShownMetric& metric : shown_metrics()) {
    const double value = report.evaluation.mean.*metric.value;
    const bool leads = metric.value == &ViewMetrics::psnr ||
                       metric.value == &ViewMetrics::psnr_dynamic ||
                       metric.value == &ViewMetrics::ssim || metric.value == &ViewMetrics::lpips ||
                       metric.value == &ViewMetrics::flow_epe_dynamic;
    if (leads && std::isfinite(value))
      html +=
          tile(metric.name, number(value * metric.scale, metric.digits), metric.unit, escaped(of));
  }
  if (report.evaluation.gaussians > 0)
    html += tile("Gaussians", grouped(double(report.evaluation.gaussians)), "",
                 "motion model " + escaped(report.facts.motion));
  if (report.facts.train_seconds > 0) {
    const std::string text = duration(report.facts.train_seconds);
    const size_t gap = text.find(' ');
    html += tile("Training", text.substr(0, gap), text.substr(gap + 1),
                 counted(size_t(std::max(0, report.facts.iterations)), "step", "steps"));
  }
  return "<dl class=\"tiles\">\n" + html + "</dl>\n";
}

const ViewMetrics* extreme(const std::vector<ViewMetrics>& views, const ShownMetric& metric,
                           bool worst) {
  const ViewMetrics* found = nullptr;
  for (const ViewMetrics& view : views) {
    const double value = view.*metric.value;
    if (!std::isfinite(value)) continue;
    const bool lower = found && value < found->*metric.value;
    const bool higher = found && value > found->*metric.value;
    if (!found || (metric.higher_is_better == worst ? lower : higher)) found = &view;
  }
  return found;
}

namespace {

TableCell extreme_cell(const std::vector<ViewMetrics>& views, const ShownMetric& metric,
                       bool worst) {
  const ViewMetrics* view = extreme(views, metric, worst);
  if (!view) return {"–", false, false};
  return {
      fmt::format("{} <small>{}</small>", number(view->*metric.value * metric.scale, metric.digits),
                  escaped(view->name)),
      false, false};
}

void add_row(std::vector<std::vector<TableCell>>& rows, const char* name, double value,
             const char* meaning) {
  if (std::isfinite(value))
    rows.push_back({{name}, {number(value, 4), true, false}, {"–"}, {"–"}, {meaning, false, true}});
}

}  // namespace

std::string metrics_section(const RunReport& report) {
  const std::vector<ViewMetrics>& views = report.evaluation.views;
  std::vector<std::vector<TableCell>> rows;
  for (const ShownMetric& metric : shown_metrics()) {
    const double mean = report.evaluation.mean.*metric.value;
    if (!std::isfinite(mean)) continue;
    const std::string unit = metric.unit[0] ? fmt::format(" <small>{}</small>", metric.unit) : "";
    rows.push_back({{metric.name + unit, false, false},
                    {number(mean * metric.scale, metric.digits), true, false},
                    extreme_cell(views, metric, true),
                    extreme_cell(views, metric, false),
                    {metric.meaning, false, true}});
  }
  if (const auto& tracks = report.evaluation.tracks) {
    add_row(rows, "3D track error", tracks->mean, "of true surface points, in scene units");
    if (tracks->seen)
      add_row(rows, "3D track error, seen", tracks->seen->mean, "of points that training has seen");
    if (tracks->from_view)
      add_row(rows, "3D track error from the view", *tracks->from_view,
              "median, of what the first view shows");
    add_row(rows, "3D track error without motion", tracks->still,
            "of a model that does not move, for comparison");
  }
  if (rows.empty()) return "";
  const std::string flow =
      report.evaluation.flow_reference == "true" ? " Flow is compared with the scene's true flow."
      : report.evaluation.flow_reference == "dis"
          ? " Flow is compared with optical flow computed from the images (DIS), where it is "
            "consistent."
          : "";
  return section("Metrics",
                 fmt::format("Means over {}, and the worst and the best of them.{}",
                             counted(views.size(), (split_in_words(report.split) + " view").c_str(),
                                     (split_in_words(report.split) + " views").c_str()),
                             flow),
                 table("Metrics",
                       {{"metric", false, true},
                        {"mean"},
                        {"worst view"},
                        {"best view"},
                        {"what it is", false, true}},
                       rows));
}

namespace {

double mean_over(const std::vector<ViewMetrics>& views, const std::vector<size_t>& which,
                 double ViewMetrics::*value) {
  double sum = 0;
  size_t count = 0;
  for (const size_t i : which)
    if (std::isfinite(views[i].*value)) sum += views[i].*value, ++count;
  return count ? sum / double(count) : std::nan("");
}

}  // namespace

std::string cameras_section(const RunReport& report) {
  if (report.cameras.size() < 2 || report.cameras.size() == report.evaluation.views.size())
    return "";
  const std::vector<ViewMetrics>& views = report.evaluation.views;
  std::vector<ShownMetric> columns;
  std::vector<TableCell> head{{"camera", false, true}, {"views"}};
  for (const ShownMetric& metric : shown_metrics()) {
    const bool wanted =
        metric.value != &ViewMetrics::psnr_unfitted && metric.value != &ViewMetrics::fl_all &&
        metric.value != &ViewMetrics::teacher_epe_dynamic && metric.value != &ViewMetrics::flow_epe;
    if (!wanted || !std::isfinite(report.evaluation.mean.*metric.value)) continue;
    columns.push_back(metric);
    head.push_back(
        {metric.name + (metric.unit[0] ? fmt::format(" [{}]", metric.unit) : ""), false, false});
  }
  std::vector<std::vector<TableCell>> rows;
  for (const CameraViews& camera : report.cameras) {
    std::vector<TableCell> row{{escaped(camera.name), false, false},
                               {grouped(double(camera.views.size())), false, false}};
    for (const ShownMetric& metric : columns)
      row.push_back(
          {number(mean_over(views, camera.views, metric.value) * metric.scale, metric.digits),
           false, false});
    rows.push_back(std::move(row));
  }
  return section("Cameras", "Means over the views of each camera.",
                 table("Metrics of each camera", head, rows));
}

namespace {

// Whether some time step has several views.
bool shares_steps(const std::vector<ViewMetrics>& views) {
  std::set<int> steps;
  for (const ViewMetrics& view : views)
    if (!steps.insert(view.step).second) return true;
  return false;
}

// Whether charts over time have a line per camera; else they show the mean and range of each step.
bool draws_lines(const RunReport& report) {
  constexpr size_t most_lines = 6;
  return report.cameras.size() <= most_lines &&
         report.cameras.size() < report.evaluation.views.size();
}

// A metric over the time steps: a line per camera, or for many cameras the mean and the range.
LineChart chart_over_time(const RunReport& report, const ShownMetric& metric) {
  const std::vector<ViewMetrics>& views = report.evaluation.views;
  LineChart chart;
  chart.title = metric.name;
  chart.unit = fmt::format("{}{}{} is better", metric.unit, metric.unit[0] ? ", " : "",
                           metric.higher_is_better ? "higher" : "lower");
  chart.x_name = "time step";
  chart.digits = metric.digits;
  chart.dots = true;
  chart.from_zero = !metric.higher_is_better;
  if (draws_lines(report)) {
    for (size_t k = 0; k < report.cameras.size(); ++k) {
      Series series{report.cameras.size() > 1 ? report.cameras[k].name : "", {}, k, false};
      for (const size_t i : report.cameras[k].views)
        if (const double value = views[i].*metric.value; std::isfinite(value))
          series.points.emplace_back(views[i].step, value * metric.scale);
      if (!series.points.empty()) chart.series.push_back(std::move(series));
    }
    return chart;
  }
  std::map<int, std::vector<double>> by_step;
  for (const ViewMetrics& view : views)
    if (const double value = view.*metric.value; std::isfinite(value))
      by_step[view.step].push_back(value * metric.scale);
  Series mean{"mean over views", {}, 0, false};
  Band band;
  bool several = false;
  for (const auto& [step, values] : by_step) {
    double sum = 0;
    for (const double value : values) sum += value;
    mean.points.emplace_back(step, sum / double(values.size()));
    band.low.emplace_back(step, *std::min_element(values.begin(), values.end()));
    band.high.emplace_back(step, *std::max_element(values.begin(), values.end()));
    several |= values.size() > 1;
  }
  if (several)
    chart.bands.push_back(std::move(band));
  else
    mean.name.clear();
  chart.series.push_back(std::move(mean));
  return chart;
}

// Whether a line has enough points to show more than its ends.
bool has_a_course(const LineChart& chart) {
  return std::any_of(chart.series.begin(), chart.series.end(),
                     [](const Series& series) { return series.points.size() > 2; });
}

}  // namespace

std::string time_section(const RunReport& report) {
  const std::vector<ViewMetrics>& views = report.evaluation.views;
  const bool several = std::any_of(views.begin(), views.end(), [&](const ViewMetrics& view) {
    return view.step != views.front().step;
  });
  if (!several) return "";
  std::string charts;
  for (const ShownMetric& metric : shown_metrics())
    if (metric.value == &ViewMetrics::psnr || metric.value == &ViewMetrics::psnr_dynamic ||
        metric.value == &ViewMetrics::ssim || metric.value == &ViewMetrics::flow_epe_dynamic)
      if (const LineChart chart = chart_over_time(report, metric); has_a_course(chart))
        charts += line_chart(chart);
  if (charts.empty()) return "";
  return section("Over time",
                 fmt::format("Each {} view at its time step{}.", split_in_words(report.split),
                             !draws_lines(report) && shares_steps(views)
                                 ? "; the area is the range over views of one step"
                                 : ""),
                 "<div class=\"charts row\">\n" + charts + "</div>\n");
}

}  // namespace gflow::report
