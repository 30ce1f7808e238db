// SPDX-License-Identifier: Apache-2.0
#include "apps/report/run_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "apps/report/html.hpp"
#include "apps/report/run_metrics.hpp"

namespace gflow::report {
namespace {

// "4000 steps in 3.7 min".
std::string effort(const RunReport& report) {
  std::string text = counted(size_t(std::max(0, report.facts.iterations)), "step", "steps");
  if (report.facts.train_seconds > 0) text += " in " + duration(report.facts.train_seconds);
  return text;
}

// "810 images of 27 cameras at 30 time steps, 640 × 360 pixels".
std::string images_in_words(const SceneFacts& scene) {
  const bool moving = scene.cameras > scene.tracks;  // several poses of one camera
  std::string cameras =
      " of " + counted(scene.tracks, "camera", moving ? "moving cameras" : "cameras");
  if (scene.tracks == 1) cameras = moving ? " of one moving camera" : " of one camera";
  if (scene.tracks == scene.images && scene.images > 1) cameras = ", each from a place of its own,";
  return fmt::format("{}{} at {}, {} × {} pixels", counted(scene.images, "image", "images"),
                     cameras, counted(size_t(std::max(0, scene.steps)), "time step", "time steps"),
                     scene.width, scene.height);
}

// What the metrics are of.
std::string evaluated_in_words(const RunReport& report) {
  const size_t count = report.evaluation.views.size();
  if (count == 0) return "No view was evaluated.";
  if (report.split == "train")
    return fmt::format(
        "The scene holds back no test views. Metrics and pictures are of {} training {}: they show "
        "how well the model fits what it has seen, not how well it shows new views.",
        grouped(double(count)), count == 1 ? "view" : "views");
  std::string text = fmt::format("Metrics and pictures are of {} held back for {}",
                                 counted(count, "view", "views"),
                                 report.split == "val" ? "validation" : "testing");
  if (report.cameras.size() < count)
    text += " from " + counted(report.cameras.size(), "camera", "cameras");
  text += report.evaluation.trained_on
              ? ", whose images were trained, too: they do not measure new views."
              : ", which training has not seen.";
  if (report.evaluation.fitted_cameras)
    text +=
        " Their camera poses were fitted to their first image, because training corrects poses.";
  return text;
}

std::string run_heading(const RunReport& report) {
  const std::string model = report.facts.motion.empty() ? ""
                                                        : fmt::format(" (motion model <b>{}</b>)",
                                                                      escaped(report.facts.motion));
  const std::string stopped =
      report.facts.finished
          ? ""
          : fmt::format(
                "<p class=\"stopped\">This training has not finished: it stopped after {} of {} "
                "steps, and this page shows the model that it left.</p>\n",
                grouped(report.facts.iterations), grouped(report.config.train.iterations));
  return fmt::format(
      "<header>\n{}<h1>{}</h1>\n{}<p class=\"lead\">A moving scene of {} Gaussians{}, trained on "
      "{}: "
      "{}{}.</p>\n<p class=\"lead\">{}</p>\n</header>\n{}",
      brand("report of a training", report.date), escaped(report.title), stopped,
      report.evaluation.gaussians > 0 ? grouped(double(report.evaluation.gaussians)) : "3D", model,
      images_in_words(report.scene), effort(report),
      report.facts.device.empty() ? "" : " on " + escaped(report.facts.device),
      evaluated_in_words(report), tiles(report));
}

std::string part(const Picture& picture, const std::string& caption, const std::string& alt) {
  return fmt::format("<figure>{}<figcaption>{}</figcaption></figure>\n", img(picture, alt),
                     escaped(caption));
}

// parts: pictures below the wipe of a view that has all of them.
std::string view_html(const ShownView& view, bool is_worst, bool is_last_step, size_t parts) {
  const ViewMetrics& m = view.metrics;
  std::string values;
  for (const ShownMetric& metric : shown_metrics())
    if ((metric.value == &ViewMetrics::psnr || metric.value == &ViewMetrics::ssim ||
         metric.value == &ViewMetrics::flow_epe_dynamic) &&
        std::isfinite(m.*metric.value))
      values += fmt::format("{}{} {}", values.empty() ? "" : " · ", metric.name,
                            with_unit(metric, m.*metric.value));
  const std::string at = fmt::format("{}, time step {}", m.name, m.step);
  std::string html = fmt::format(
      "<article class=\"view\">\n<h3>{}{}<span>time step {}</span><span>{}</span></h3>\n",
      escaped(m.name), is_worst ? " <em>worst PSNR</em>" : "", m.step, values);
  html += fmt::format(
      "<div class=\"wipe\" tabindex=\"0\" role=\"group\" aria-label=\"{}: image and render under a "
      "wipe, scroll sideways to compare\"><div>\n<figure class=\"model\">{}<figcaption>render"
      "</figcaption></figure>\n<figure class=\"truth\">{}<figcaption>image</figcaption></figure>\n"
      "<span class=\"edge\"></span><span class=\"middle\"></span></div></div>\n",
      escaped(m.name), img(view.rendered, "Render of " + at), img(view.truth, "Image of " + at));
  html += fmt::format("<div class=\"parts\" style=\"--parts:{}\">\n", parts) +
          part(view.error, "error × 4", "Error of the render of " + at);
  if (!view.flow.empty())
    html += part(view.flow, "flow of the model", "Flow of the model in " + at);
  if (!view.target.empty()) html += part(view.target, "reference flow", "Reference flow in " + at);
  if (parts > 1 && view.flow.empty() && is_last_step)
    html += "<p class=\"missing\">No flow: there is no later time step.</p>\n";
  return html + "</div>\n</article>\n";
}

std::string views_section(const RunReport& report) {
  if (report.views.empty()) return "";
  const ViewMetrics* worst = extreme(report.evaluation.views, shown_metrics().front(), true);
  std::string html;
  size_t parts = 1;
  for (const ShownView& view : report.views)
    parts = std::max(parts, size_t{1} + !view.flow.empty() + !view.target.empty());
  for (const ShownView& view : report.views)
    html += view_html(view, worst && view.metrics.name == worst->name,
                      view.metrics.step + 1 == report.scene.steps, parts);
  std::string keys = "<div>Error: difference of image and render, four times as strong.</div>";
  if (parts > 1)
    keys =
        fmt::format(
            "<div>{}<span>Flow: where each pixel moves until the next time step. The colour is the "
            "direction, as in the wheel; it is strongest at {} px. White: does not move. Black: "
            "not known.</span></div>",
            img(flow_wheel(), "Colour wheel of directions"), number(report.flow_length, 1)) +
        keys;
  std::string about =
      fmt::format("{} of the {} views, spread over cameras and times",
                  report.views.size() == 1 ? "One" : grouped(double(report.views.size())),
                  split_in_words(report.split));
  if (worst) about += fmt::format("; the worst of all by PSNR is <b>{}</b>", escaped(worst->name));
  about +=
      ".<span class=\"hint\"> Drag or scroll a picture sideways to wipe between image and "
      "render.</span>";
  return section(
      report.split == "train" ? "Training views" : "Views", about,
      "<div class=\"keys\">" + keys + "</div>\n<div class=\"views\">\n" + html + "</div>\n");
}

std::string notices_section(const RunReport& report) {
  if (report.notices.empty()) return "";
  std::string items;
  for (const std::string& notice : report.notices) items += "<li>" + escaped(notice) + "</li>\n";
  return section("Notices", "What gflow said while it trained, and about the scene.",
                 "<ul class=\"notes\">\n" + items + "</ul>\n");
}

std::string settings_section(const RunReport& report) {
  const std::map<std::string, std::string> defaults = setting_values(TrainOptions{});
  std::vector<std::vector<TableCell>> rows;
  for (const SettingInWords& setting : settings_in_words(report.config)) {
    const auto usual = defaults.find(setting.name);
    // Where files are on this machine tells a reader nothing.
    if (setting.name == "scene.path" || (usual != defaults.end() && usual->second == setting.value))
      continue;
    rows.push_back({{"<code>" + escaped(setting.name) + "</code>", false, false},
                    {escaped(setting.value), true, true},
                    {usual == defaults.end() ? "–" : escaped(usual->second), false, true},
                    {escaped(setting.meaning), false, true}});
  }
  if (rows.empty()) return section("Settings", "All settings had their default values.", "");
  return section("Settings",
                 "Those that differ from the defaults. All are in <code>config.toml</code> of the "
                 "run.",
                 table("Settings that differ from the defaults",
                       {{"setting", false, true},
                        {"value", false, true},
                        {"default", false, true},
                        {"meaning", false, true}},
                       rows));
}

void add_fact(std::string& list, const std::string& name, const std::string& value) {
  if (!value.empty()) list += fmt::format("<dt>{}</dt><dd>{}</dd>\n", name, value);
}

std::string facts_section(const RunReport& report) {
  const RunFacts& facts = report.facts;
  std::string list;
  add_fact(list, "Scene",
           fmt::format("{} ({})", escaped(report.scene.name), escaped(report.scene.layout)));
  add_fact(list, "Model",
           fmt::format("{} Gaussians, motion model {}, seed {}",
                       grouped(double(report.evaluation.gaussians)), escaped(facts.motion),
                       report.config.train.seed));
  add_fact(list, "Steps",
           fmt::format(
               "{} of {}{}", grouped(facts.iterations), grouped(report.config.train.iterations),
               facts.train_seconds > 0 && facts.iterations > 0
                   ? fmt::format(", {:.0f} ms each", 1000 * facts.train_seconds / facts.iterations)
                   : ""));
  if (facts.train_seconds > 0)
    add_fact(list, "Time", duration(facts.train_seconds) + ", without evaluation");
  if (facts.peak_memory_mib > 0)
    add_fact(list, "Peak memory", grouped(facts.peak_memory_mib) + " MiB, of the process");
  add_fact(list, "Device", escaped(facts.device));
  add_fact(list, "Driver", escaped(report.driver));
  add_fact(list, "gflow", escaped(report.version));
  add_fact(list, "Look at it", "<code>gflow view " + escaped(report.run) + "</code>");
  add_fact(list, "Continue with it",
           "<code>gflow export " + escaped(report.run) +
               " -o scene.html</code> makes one file for any browser");
  return section("Run", "", "<dl class=\"facts\">\n" + list + "</dl>\n");
}

}  // namespace

std::string run_report_html(const RunReport& report) {
  const std::string curves = training_charts(report.log);
  std::string html = run_heading(report);
  if (!curves.empty())
    html += section(
        "Training",
        is_smoothed(report.log) ? "Pale lines are single steps, strong ones their local mean." : "",
        curves);
  html += time_section(report);
  html += metrics_section(report);
  html += cameras_section(report);
  html += views_section(report);
  html += notices_section(report);
  html += settings_section(report);
  html += facts_section(report);
  return page(report.title + ", report of gflow", html);
}

}  // namespace gflow::report
