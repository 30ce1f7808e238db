// SPDX-License-Identifier: Apache-2.0
// `gflow bench pareto`: run time against error. Each choice about the image is tried alone: the
// time of an image with flow and its gradients, and their errors against double.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>

#include "apps/bench/bench.hpp"
#include "apps/bench/measure/choices.hpp"
#include "apps/bench/measure/exact.hpp"
#include "apps/bench/measure/front.hpp"
#include "apps/common/command_line.hpp"
#include "runtime/base/output.hpp"
#ifdef GFLOW_WITH_OPENCV
#include "apps/bench/measure/trained.hpp"
#endif

namespace gflow::bench {
namespace {

struct ParetoOptions {
  BenchOptions common;
  std::string pixels = "512x512", check_pixels = "96x96";
  size_t gaussians = 100000, check_gaussians = 1400;
  std::vector<std::string> knobs;  // empty: all
#ifdef GFLOW_WITH_OPENCV
  TrainingOptions training;
#endif
};

struct Measured {
  Choice choice;
  Cost cost, beside;  // beside: the default settings in the same repeats
  Exact::Found found;
  // CPU time relative to the default settings.
  Spread of_shipped() const {
    return choice.shipped() ? Spread{1, 1, 1} : ratio_of(cost.cpu_ms, beside.cpu_ms);
  }
};

// All measured errors.
std::vector<double> all_errors(const Exact::Found& found) {
  const Errors &a = found.as_defined, &b = found.without_cutoffs;
  return {a.rgb, a.flow_px, a.gradients, b.rgb, b.flow_px, b.gradients};
}

// The kernels from Gaussians at both times to their gradients.
class Shown {
 public:
  Shown(Queue& queue, BenchScene& scene, const EngineSettings& settings, ImageGradients v)
      : queue_(queue), scene_(scene), engine_(queue, settings), v_(std::move(v)) {
    gradients_.zero(queue, scene.count);
  }
  void operator()() {
    engine_.forward(queue_, scene_.view, {true, false}, {0, 0, 0}, scene_.at_t1, scene_.at_t2,
                    scene_.colors);
    engine_.backward(queue_, scene_.at_t1, scene_.at_t2, v_, gradients_);
  }
  const Engine& engine() const { return engine_; }
  const GaussianGradients& gradients() const { return gradients_; }

 private:
  Queue& queue_;
  BenchScene& scene_;
  Engine engine_;
  ImageGradients v_;
  GaussianGradients gradients_;
};

ImageGradients uploaded(Queue& queue, const reference::Planes& v) {
  const auto upload = [&](const std::vector<double>& plane, const char* name) {
    return Buffer<float>(queue, std::vector<float>(plane.begin(), plane.end()), name);
  };
  ImageGradients out;
  out.v_rgb = upload(v.rgb, "v_rgb");
  out.v_alpha = upload(v.alpha, "v_alpha");
  out.v_flow = upload(v.flow, "v_flow");
  return out;
}

// A queue with this number of lanes (0: the device's), the scene that is timed, and the small one
// that is compared with double.
struct Place {
  Place(const GlobalOptions& options, const ParetoOptions& o, int lanes) {
    QueueOptions queue_options;
    queue_options.profile = true;
    queue_options.lanes = lanes;
    queue = std::make_unique<Queue>(open_queue(options, queue_options));
    scene = posed("--pixels", o.pixels, o.gaussians);
    small = posed("--check-pixels", o.check_pixels, o.check_gaussians);
  }
  std::unique_ptr<BenchScene> posed(const std::string& option, const std::string& pixels,
                                    size_t gaussians) {
    const auto [width, height] = size_named(option, pixels);
    auto made = std::make_unique<BenchScene>(random_scene(*queue, width, height, gaussians));
    made->pose(*queue);
    return made;
  }
  std::unique_ptr<Queue> queue;
  std::unique_ptr<BenchScene> scene, small;
};

Shown timed(const Place& place, const EngineSettings& settings) {
  const PinholeCamera& camera = place.scene->view.camera;
  const size_t pixels = size_t(camera.width) * size_t(camera.height);
  return {*place.queue, *place.scene, settings,
          random_gradients(*place.queue, pixels, {true, false})};
}

// Uses all errors: those without cut-offs do not show rounding, those as defined do not show what
// cut-offs remove.
std::vector<bool> front_of(const std::vector<Measured>& all) {
  std::vector<TimeAndErrors> costs;
  for (const Measured& m : all) costs.push_back({m.of_shipped().median, all_errors(m.found)});
  return pareto_front(costs);
}

// Six plots of error over time: without cut-offs above, as defined below. Choices on the front are
// blue, the default settings red. A line connects the labelled choices that no other one on the
// front beats in time and this error.
Plot plot_of(const std::vector<Measured>& all, const std::vector<bool>& front) {
  struct Part {
    const char* title;
    double (*error)(const Exact::Found&);
  };
  const Part parts[] = {
      {"without cut-offs: colour, RMS",
       [](const Exact::Found& f) { return f.without_cutoffs.rgb; }},
      {"without cut-offs: flow, RMS [px]",
       [](const Exact::Found& f) { return f.without_cutoffs.flow_px; }},
      {"without cut-offs: gradients, relative L2",
       [](const Exact::Found& f) { return f.without_cutoffs.gradients; }},
      {"as defined: colour, RMS", [](const Exact::Found& f) { return f.as_defined.rgb; }},
      {"as defined: flow, RMS [px]", [](const Exact::Found& f) { return f.as_defined.flow_px; }},
      {"as defined: gradients, relative L2",
       [](const Exact::Found& f) { return f.as_defined.gradients; }}};
  Plot plot;
  plot.name = "pareto";
  plot.width = 1700;
  plot.height = 1050;
  plot.table = {{"choice", "time", "front"}};
  plot.script =
      "set termoption noenhanced\nset datafile missing '?'\nset logscale y\nset format y "
      "'%.0e'\nset xrange [*:1.3]\nset offsets graph 0.03,0,0,0\n"
      "set xlabel 'CPU time, of the shipped settings (more than 1.3 is not shown)'\n"
      "set multiplot layout 2,3 title 'blue: on the front; red: defaults; grey: something else "
      "is "
      "as fast and as exact'\nset key off\n";
  int column = 3;
  for (const Part& part : parts) {
    plot.table[0].insert(plot.table[0].end(), {part.title, "time, on the line", "label"});
    plot.script += fmt::format(
        "set title '{0}'\n"
        "plot 'pareto.tsv' every ::1 using {2}:{1} smooth unique with lines "
        "lw 2 lc rgb 'light-blue', "
        "'' every ::1 using 2:{1} with points pt 7 lc rgb 'grey', "
        "'' every ::1 using ($3==1?$2:1/0):{1} with points pt 7 lc rgb 'blue', "
        "'' every ::1 using 2:{1}:{3} with labels font ',9' left offset 0.6,0, "
        "'' every ::1::1 using 2:{1} with points pt 6 ps 2 lw 2 lc rgb 'red', "
        "'' every ::1::1 using 2:{1}:1 with labels font ',9' tc rgb 'red' right offset -1,-0.8\n",
        part.title, column + 1, column + 2, column + 3);
    column += 3;
  }
  plot.script += "unset multiplot";
  for (size_t i = 0; i < all.size(); ++i) {
    const Measured& m = all[i];
    const double time = m.of_shipped().median;
    std::vector<std::string> line{m.choice.name, fmt::format("{:.4g}", time), front[i] ? "1" : "0"};
    for (const Part& part : parts) {
      const double error = part.error(m.found);
      bool leads = front[i];
      for (size_t k = 0; k < all.size() && leads; ++k) {
        const double slower = time / all[k].of_shipped().median;
        const double worse = error / part.error(all[k].found);
        const bool as_good = k != i && front[k] && slower > 1 / 1.03 && worse > 1 / 1.1;
        leads = !(as_good && (slower > 1.03 || worse > 1.1 || k < i));
      }
      line.push_back(fmt::format("{:.3e}", error));
      line.push_back(leads ? line[1] : "?");
      line.push_back(leads && !m.choice.shipped() ? m.choice.name : "");
    }
    plot.table.push_back(line);
  }
  return plot;
}

std::string markdown_of(const Queue& queue, const ParetoOptions& o,
                        const std::vector<Measured>& all, const std::vector<bool>& front) {
  std::string text = fmt::format(
      "# {}\n\n"
      "Written by `gflow bench pareto --markdown`: an image with flow and its gradients, {} and {} "
      "random Gaussians, without motion model and Adam. CPU time, as a ratio to that of the "
      "shipped settings ({:.1f} ms) in the same repeat: the median of {} and its quartiles. Errors "
      "at {} and {} against the shipped definition in double: with its cut-offs, and without any. "
      "**On the front**: nothing else here is as fast, to 3 %, and as exact, to 3 %, in each of "
      "the six errors, and in one of them better (3 % of time, 10 % of an error).\n\n"
      "| choice | CPU time, of shipped | colour, as defined | flow [px] | gradients | "
      "colour, without cut-offs | flow [px] | gradients | front |\n"
      "|---|---|---|---|---|---|---|---|---|\n",
      queue.info.full_name(), o.pixels, o.gaussians, spread_of(all[0].cost.cpu_ms).median,
      o.common.repeats, o.check_pixels, o.check_gaussians);
  for (size_t i = 0; i < all.size(); ++i) {
    const Measured& m = all[i];
    const Spread time = m.of_shipped();
    text += m.choice.shipped() ? "| **shipped** | **1** |"
                               : fmt::format("| {} | {:.2f} ({:.2f} - {:.2f}) |", m.choice.name,
                                             time.median, time.low, time.high);
    for (const double error : all_errors(m.found)) text += fmt::format(" {:.1e} |", error);
    text += fmt::format(" {} |\n", front[i] ? "yes" : "");
  }
  return text;
}

#ifdef GFLOW_WITH_OPENCV

// Mean and deviation with this many digits; "-" if nothing was measured.
std::string in_words(const Samples& values, int digits) {
  const MeanAndDeviation m = mean_of(values);
  if (std::isnan(m.mean)) return "-";
  if (values.size() < 2) return fmt::format("{:.{}f}", m.mean, digits);
  return fmt::format("{:.{}f} ± {:.{}f}", m.mean, digits, m.deviation, digits);
}

std::string markdown_of(const TrainingOptions& o, const std::vector<TrainedChoice>& all) {
  std::string text = fmt::format(
      "\n## In training\n\n"
      "On `{}`{}{}: a training of {} steps with the shipped settings, with each choice of as many "
      "steps as fit into the same CPU time, and what it shows of cameras it never saw. CPU time of "
      "a step with flow, motion model and Adam, in the same repeat; mean and deviation of {} "
      "seed{}.\n\n"
      "| choice | CPU time of a step, of shipped | steps | PSNR [dB] | PSNR, moving [dB] | flow "
      "error, moving [px] |\n"
      "|---|---|---|---|---|---|\n",
      std::filesystem::path(o.scene).lexically_normal().filename().string(),
      o.settings.empty() ? "" : " with ", fmt::join(o.settings, ", "), o.steps, o.seeds,
      o.seeds == 1 ? "" : "s");
  for (const TrainedChoice& one : all) {
    const Spread& time = one.of_shipped;
    text += one.choice.shipped() ? "| **shipped** | **1** |"
                                 : fmt::format("| {} | {:.2f} ({:.2f} - {:.2f}) |", one.choice.name,
                                               time.median, time.low, time.high);
    text += fmt::format(" {} | {} | {} | {} |\n", one.steps, in_words(one.psnr, 2),
                        in_words(one.psnr_dynamic, 2), in_words(one.flow_epe_dynamic, 3));
  }
  return text;
}

void add_rows(Report& report, const std::vector<TrainedChoice>& all) {
  for (const TrainedChoice& one : all) {
    const auto measurement = [](const char* name, const Samples& values, bool quality) {
      const auto [least, most] = std::minmax_element(values.begin(), values.end());
      return Measurement{name, {mean_of(values).mean, *least, *most}, true, !quality, quality};
    };
    report.add({one.choice.name + ", trained",
                {{"CPU of a step, of shipped", one.of_shipped},
                 single("steps", one.steps),
                 measurement("PSNR [dB]", one.psnr, true),
                 measurement("moving [dB]", one.psnr_dynamic, true),
                 measurement("flow error, moving [px]", one.flow_epe_dynamic, false)}});
  }
}

// Cost of a step, and results of trainings with equal time: one line per choice, the default one
// first and as a line through all plots.
Plot plot_of(const std::vector<TrainedChoice>& all) {
  struct Part {
    const char* title;
    Samples TrainedChoice::*values;
  };
  const Part parts[] = {{"PSNR [dB]", &TrainedChoice::psnr},
                        {"PSNR, moving [dB]", &TrainedChoice::psnr_dynamic},
                        {"flow error, moving [px]", &TrainedChoice::flow_epe_dynamic}};
  Plot plot;
  plot.name = "pareto_trained";
  plot.width = 1700;
  plot.height = 160 + 20 * int(all.size());
  plot.table = {{"choice", "CPU time of a step, of shipped", "from", "to"}};
  for (const Part& part : parts)
    plot.table[0].insert(plot.table[0].end(), {part.title, "less deviation", "and deviation"});
  for (const TrainedChoice& one : all) {
    std::vector<std::string> line{one.choice.name};
    const auto add = [&](double value, double low, double high) {
      for (const double x : {value, low, high})
        line.push_back(std::isfinite(x) ? fmt::format("{:.4f}", x) : "?");
    };
    add(one.of_shipped.median, one.of_shipped.low, one.of_shipped.high);
    for (const Part& part : parts) {
      const MeanAndDeviation m = mean_of(one.*part.values);
      add(m.mean, m.mean - m.deviation, m.mean + m.deviation);
    }
    plot.table.push_back(std::move(line));
  }
  plot.script = fmt::format(
      "set termoption noenhanced\nset datafile missing '?'\nset key off\n"
      "set yrange [{}:-1]\nset ytics 1\nset xtics font ',9'\nset bars 0.5\n"
      "set multiplot layout 1,4 margins 0.15,0.985,{:.3f},{:.3f} spacing 0.02,0 "
      "title 'trainings of the same time, mean and deviation of their seeds; red: defaults'\n",
      all.size(), 40.0 / plot.height, 1 - 70.0 / plot.height);
  for (int column = 2; column <= 11; column += 3) {
    const bool first = column == 2;
    plot.script += fmt::format(
        "set title '{0}'\n{5}"
        "plot 'pareto_trained.tsv' every ::1 using {1}:0:{2}:{3}{4} with xerrorbars pt 7 lc rgb "
        "'blue', '' every ::1::1 using {1}:(-1):(0):({6}) with vectors nohead lc rgb 'red'\n",
        plot.table[0][size_t(column) - 1], column, column + 1, column + 2,
        first ? ":yticlabels(1)" : "",
        first ? "set logscale x 2\n" : "unset logscale\nset format y ''\n", all.size() + 1);
  }
  plot.script += "unset multiplot";
  return plot;
}

#endif

Result run_pareto(const ParetoOptions& o, const GlobalOptions& options) {
  const Place home(options, o, 0);
  Json facts{{"pixels", o.pixels},
             {"gaussians", o.gaussians},
             {"check pixels", o.check_pixels},
             {"check gaussians", o.check_gaussians},
             {"repeats", o.common.repeats}};
#ifdef GFLOW_WITH_OPENCV
  if (const TrainingOptions& t = o.training; !t.scene.empty())
    facts["trained"] = {
        {"scene", t.scene}, {"steps", t.steps}, {"seeds", t.seeds}, {"settings", t.settings}};
#endif
  Report report("pareto", *home.queue, facts, o.common.compare);
  const Exact exact(*home.queue, *home.small);
  Shown shipped = timed(home, {});
  std::vector<Measured> all;
  const std::vector<Choice> tried = choices_of(home.queue->lanes, o.knobs);
  for (const Choice& choice : tried) {
    if (!options.quiet) print_status("{} of {}: {}\n", all.size() + 1, tried.size(), choice.name);
    std::unique_ptr<Place> other;
    if (choice.lanes) other = std::make_unique<Place>(options, o, choice.lanes);
    const Place& place = other ? *other : home;
    Shown tried_one = timed(place, choice.settings);
    const auto [cost, beside] = costs_in_turn(
        *place.queue, [&] { tried_one(); }, *home.queue, [&] { shipped(); }, o.common.repeats);
    Shown shown(*place.queue, *place.small, choice.settings, uploaded(*place.queue, exact.loss()));
    shown();
    all.push_back({choice, cost, beside,
                   exact.compare(*place.queue, shown.engine().images(), shown.gradients())});
  }
  const std::vector<bool> front = front_of(all);
  for (size_t i = 0; i < all.size(); ++i) {
    const Measured& m = all[i];
    const Errors &a = m.found.as_defined, &b = m.found.without_cutoffs;
    report.add({m.choice.name,
                {{"CPU, of shipped", m.of_shipped()},
                 {"CPU [ms]", spread_of(m.cost.cpu_ms)},
                 single("shipped beside it [ms]", spread_of(m.beside.cpu_ms).median),
                 error("colour", a.rgb),
                 error("flow [px]", a.flow_px),
                 error("gradients", a.gradients),
                 error("colour, all", b.rgb),
                 error("flow, all [px]", b.flow_px),
                 error("gradients, all", b.gradients),
                 single("on the front", front[i])}});
  }
  std::vector<Plot> plots{plot_of(all, front)};
  std::string markdown = markdown_of(*home.queue, o, all, front);
#ifdef GFLOW_WITH_OPENCV
  if (!o.training.scene.empty()) {
    const std::vector<TrainedChoice> trained =
        train_choices(*home.queue, tried, o.training, o.common.repeats, options);
    add_rows(report, trained);
    plots.push_back(plot_of(trained));
    markdown += markdown_of(o.training, trained);
  }
#endif
  report.measure_peak_again(*home.queue);
  return {std::move(report), std::move(plots), std::move(markdown)};
}

}  // namespace

void add_pareto(CLI::App& bench, const GlobalOptions& options) {
  auto flags = std::make_shared<ParetoOptions>();
  CLI::App* pareto = bench.add_subcommand(
      "pareto", "Run time against error, for every choice of image, flow and gradients");
  pareto->add_option("--pixels", flags->pixels, "Size of the timed image")->type_name("WxH");
  pareto->add_option("--gaussians", flags->gaussians, "Gaussians in the timed image")
      ->check(number_in(1, 20000000));
  pareto
      ->add_option("--check-pixels", flags->check_pixels,
                   "Size of the image compared with double precision")
      ->type_name("WxH");
  pareto->add_option("--check-gaussians", flags->check_gaussians, "Gaussians in the compared image")
      ->check(number_in(1, 100000));
  pareto->add_option("--knob", flags->knobs, "Try only this choice, e.g. top_k; may be repeated")
      ->type_name("NAME")
      ->expected(1)
      ->default_str("")
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
#ifdef GFLOW_WITH_OPENCV
  TrainingOptions& training = flags->training;
  pareto
      ->add_option("--scene", training.scene,
                   "Also train this scene with each choice, for the time of --steps with default "
                   "settings, and evaluate the result")
      ->type_name("PATH");
  pareto->add_option("--steps", training.steps, "Training steps with default settings")
      ->check(number_in(1, 1000000));
  pareto->add_option("--seeds", training.seeds, "Trainings per choice")->check(number_in(1, 100));
  pareto->add_option("--set", training.settings, "Setting of these trainings; may be repeated")
      ->type_name("SECTION.KEY=VALUE")
      ->expected(1)
      ->default_str("")
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
#endif
  pareto->add_option("--markdown", flags->common.markdown, "Write the table to this file")
      ->check(path_given())
      ->type_name("FILE.md");
  add_common(*pareto, flags->common);
  pareto->callback([flags, &options] {
    choices_of(0, flags->knobs);  // an unknown knob is an Error before anything is measured
#ifdef GFLOW_WITH_OPENCV
    if (!flags->training.scene.empty()) require_trainable(flags->training);
#endif
    deliver(flags->common, [&] { return run_pareto(*flags, options); });
  });
}

}  // namespace gflow::bench
