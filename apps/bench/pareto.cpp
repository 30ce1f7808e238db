// SPDX-License-Identifier: Apache-2.0
// `gflow bench pareto`: run time against error. Every choice about the image, tried alone: the time
// of an image with flow and its gradients, and how far they are from double.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "apps/bench/bench.hpp"
#include "apps/bench/exact.hpp"
#include "apps/bench/front.hpp"
#include "apps/command_line.hpp"

namespace gflow::bench {
namespace {

struct ParetoOptions {
  BenchOptions common;
  std::string pixels = "512x512", check_pixels = "96x96";
  size_t gaussians = 100000, check_gaussians = 1400;
  std::vector<std::string> knobs;  // empty: all
};

// One choice: what differs from the settings as shipped.
struct Choice {
  std::string knob, name;
  EngineSettings settings;
  int lanes = 0;  // 0: the device's
  bool shipped() const { return knob == "shipped"; }
};

std::vector<Choice> choices(int lanes) {
  std::vector<Choice> all{{"shipped", "shipped", {}}};
  const auto add = [&](const char* knob, const std::string& value) -> EngineSettings& {
    all.push_back({knob, fmt::format("{} {}", knob, value), {}});
    return all.back().settings;
  };
  for (const char* name : {"paper", "ot", "translate"})
    add("transport", name).transport = transport_named(name);
  for (const int k : {1, 4, 16, 20, 32, 64}) add("top_k", std::to_string(k)).top_k = k;
  add("stop", "exclude").stop = StopRule::exclude;
  for (const char* t : {"1e-2f", "1e-3f", "1e-5f", "1e-6f"})
    add("T_MIN", t).defines = {{"T_MIN", t}};
  // log2 of 1/64, 1/128, 1/512, 1/2048
  for (const auto& [name, log2] :
       {std::pair{"1/64", "-6.f"}, {"1/128", "-7.f"}, {"1/512", "-9.f"}, {"1/2048", "-11.f"}})
    add("alpha >=", name).defines = {{"ALPHA_MIN_LOG2", log2}};
  for (const auto& [name, degree] :
       {std::pair{"degree 3", "3"}, {"degree 4", "4"}, {"built in", "0"}, {"native", "1"}})
    add("exp2", name).defines = {{"EXP2_DEGREE", degree}};
  add("moments kept in", "16 bits").defines = {{"MOMENT_BITS", "16"}};
  add("boxes", "loose").skip.boxes = false;
  for (const char* sigmas : {"3.f", "2.5f", "2.f"})
    add("boxes", fmt::format("of at most {} sigma", sigmas)).defines = {{"BOX_SIGMAS", sigmas}};
  add("cell masks", "off").skip.masks = false;
  add("saturated tiles", "walked on").skip.saturated = false;
  Skips& none = add("skips", "none").skip;
  Skips::fields(none, [](const char*, bool& on, const char*) { on = false; });
  for (const int w : {1, 4, 8, 16})
    if (w != lanes) {
      all.push_back({"lanes", fmt::format("lanes {}", w), {}, w});
    }
  return all;
}

// The shipped one and those of the knobs asked for. Error when there is no such knob.
std::vector<Choice> chosen(int lanes, const std::vector<std::string>& knobs) {
  std::vector<Choice> all = choices(lanes);
  std::vector<std::string> known;
  for (const Choice& choice : all)
    if (!choice.shipped() && (known.empty() || known.back() != choice.knob))
      known.push_back(choice.knob);
  for (const std::string& knob : knobs)
    if (std::find(known.begin(), known.end(), knob) == known.end())
      throw Error(fmt::format("--knob {}: there is none, but {}", knob, fmt::join(known, ", ")));
  if (knobs.empty()) return all;
  const auto unwanted = [&](const Choice& choice) {
    return !choice.shipped() && std::find(knobs.begin(), knobs.end(), choice.knob) == knobs.end();
  };
  all.erase(std::remove_if(all.begin(), all.end(), unwanted), all.end());
  return all;
}

constexpr char kNativeIsBuiltIn[] =
    "exp2 native is the same as built in on this device: their errors are equal";

struct Measured {
  Choice choice;
  Cost cost, beside;  // the latter: of the shipped settings, in the same repeats
  Exact::Found found;
  // CPU time, of that of the shipped settings.
  Spread of_shipped() const {
    return choice.shipped() ? Spread{1, 1, 1} : ratio_of(cost.cpu_ms, beside.cpu_ms);
  }
};

// How wrong it is in every way that is measured.
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

// A queue for so many lanes (0: the device's own number) with the scene that is timed, and the
// small one that is compared.
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

// By all errors: those without cut-offs do not show rounding, those as defined not what is left
// out.
std::vector<bool> front_of(const std::vector<Measured>& all) {
  std::vector<TimeAndErrors> costs;
  for (const Measured& m : all) costs.push_back({m.of_shipped().median, all_errors(m.found)});
  return pareto_front(costs);
}

// Devices whose exp2 and native_exp2 are one: "exp2 native" is no choice there.
bool native_is_built_in(const std::vector<Measured>& all) {
  const auto errors_of = [&](const std::string& name) {
    const auto found = std::find_if(all.begin(), all.end(),
                                    [&](const Measured& m) { return m.choice.name == name; });
    return found == all.end() ? std::vector<double>() : all_errors(found->found);
  };
  const std::vector<double> native = errors_of("exp2 native");
  return !native.empty() && native == errors_of("exp2 built in");
}

// Six pictures of error over time: without cut-offs above, as defined below. Who is on the front is
// blue, the shipped settings are red. A line leads through those that no other on the front beats
// in time and the error of that picture; these have labels, one where several are hardly apart.
Plot plot_of(const std::vector<Measured>& all, const std::vector<bool>& front) {
  struct Part {
    const char* title;
    double (*error)(const Exact::Found&);
  };
  const Part parts[] = {
      {"colour, RMS, without cut-offs",
       [](const Exact::Found& f) { return f.without_cutoffs.rgb; }},
      {"flow, RMS [px]", [](const Exact::Found& f) { return f.without_cutoffs.flow_px; }},
      {"gradients, relative L2", [](const Exact::Found& f) { return f.without_cutoffs.gradients; }},
      {"colour, RMS, as defined", [](const Exact::Found& f) { return f.as_defined.rgb; }},
      {"flow, RMS [px]", [](const Exact::Found& f) { return f.as_defined.flow_px; }},
      {"gradients, relative L2", [](const Exact::Found& f) { return f.as_defined.gradients; }}};
  Plot plot;
  plot.name = "pareto";
  plot.width = 1700;
  plot.height = 1050;
  plot.table = {{"choice", "time", "front"}};
  plot.script =
      "set termoption noenhanced\nset datafile missing '?'\nset logscale y\nset format y "
      "'%.0e'\nset xrange [0.7:2.2]\n"
      "set xlabel 'CPU time, of the shipped settings (more than 2.2 is not shown)'\n"
      "set multiplot layout 2,3\nset key off\n";
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
        "'' every ::1::1 using 2:{1}:1 with labels font ',9' tc rgb 'red' left offset 1,0.7\n",
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
      "**On the front**: nothing else here is as fast, to 3 %, and as exact, to 1 %, in each of "
      "the six errors, and in one of them better (3 % of time, 10 % of an error).{}\n\n"
      "| choice | CPU time, of shipped | colour, as defined | flow [px] | gradients | "
      "colour, without cut-offs | flow [px] | gradients | front |\n"
      "|---|---|---|---|---|---|---|---|---|\n",
      queue.info.full_name(), o.pixels, o.gaussians, spread_of(all[0].cost.cpu_ms).median,
      o.common.repeats, o.check_pixels, o.check_gaussians,
      native_is_built_in(all) ? fmt::format(" {}.", kNativeIsBuiltIn) : "");
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

Result run_pareto(const ParetoOptions& o, const GlobalOptions& options) {
  const Place home(options, o, 0);
  Report report("pareto", *home.queue,
                {{"pixels", o.pixels},
                 {"gaussians", o.gaussians},
                 {"check pixels", o.check_pixels},
                 {"check gaussians", o.check_gaussians},
                 {"repeats", o.common.repeats}},
                o.common.compare);
  const Exact exact(*home.queue, *home.small);
  Shown shipped = timed(home, {});
  std::vector<Measured> all;
  const std::vector<Choice> tried = chosen(home.queue->lanes, o.knobs);
  for (const Choice& choice : tried) {
    if (!options.quiet)
      fmt::print(stderr, "{} of {}: {}\n", all.size() + 1, tried.size(), choice.name);
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
  if (native_is_built_in(all)) report.note(kNativeIsBuiltIn);
  report.measure_peak_again(*home.queue);
  return {std::move(report), plot_of(all, front), markdown_of(*home.queue, o, all, front)};
}

}  // namespace

void add_pareto(CLI::App& bench, const GlobalOptions& options) {
  auto flags = std::make_shared<ParetoOptions>();
  CLI::App* pareto = bench.add_subcommand(
      "pareto", "Run time against error, for every choice about the image, flow and gradients");
  pareto->add_option("--pixels", flags->pixels, "Size of the image that is timed")
      ->type_name("WxH");
  pareto->add_option("--gaussians", flags->gaussians, "How many are in it")
      ->check(number_in(1, 20000000));
  pareto
      ->add_option("--check-pixels", flags->check_pixels,
                   "Size of the image that is compared with double")
      ->type_name("WxH");
  pareto->add_option("--check-gaussians", flags->check_gaussians, "How many are in that")
      ->check(number_in(1, 100000));
  pareto->add_option("--knob", flags->knobs, "Try this one only, e.g. top_k; may be repeated")
      ->type_name("NAME")
      ->expected(1)
      ->default_str("")
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  pareto->add_option("--markdown", flags->common.markdown, "Write the table here")
      ->type_name("FILE.md");
  add_common(*pareto, flags->common);
  pareto->callback([flags, &options] {
    chosen(0, flags->knobs);  // refuses before anything is made
    deliver(flags->common, [&] { return run_pareto(*flags, options); });
  });
}

}  // namespace gflow::bench
