// SPDX-License-Identifier: Apache-2.0
// `gflow bench step`: whole training steps on a scene, with and without what training may ask for
// beside the pictures. All kinds of step go on from one training, over the same views.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <memory>

#include "apps/bench/bench.hpp"
#include "apps/command_line.hpp"
#include "optim/train/preparation.hpp"
#include "optim/train/progress.hpp"
#include "runtime/usage.hpp"

namespace gflow::bench {
namespace {

namespace fs = std::filesystem;

struct StepOptions {
  BenchOptions common;
  std::string scene;
  std::vector<std::string> settings;
  int warm = 1500, block = 20;
};

// A folder for computed flow, gone at the end.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string name = (fs::temp_directory_path() / "gflow-bench-XXXXXX").string();
    if (!mkdtemp(name.data())) throw Error(fmt::format("cannot make a folder {}", name));
    path_ = name;
  }
  ~ScratchFolder() {
    std::error_code problem;
    fs::remove_all(path_, problem);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  std::string file(const char* name) const { return (fs::path(path_) / name).string(); }

 private:
  std::string path_;
};

// A kind of step: a name and what it changes of the settings.
struct Kind {
  std::string name;
  std::vector<std::string> settings;
};
const std::vector<Kind> kinds{{"pictures alone", {"flow.enabled=false"}},
                              {"with flow", {}},
                              {"flow, rigidity", {"loss.rigidity=1"}},
                              {"flow, rotation", {"loss.rotation=1"}},
                              {"flow, isometry", {"loss.isometry=1"}},
                              {"flow, velocity", {"loss.velocity=1"}},
                              {"flow, acceleration", {"loss.acceleration=1"}}};

TrainConfig configured(const StepOptions& o, const std::vector<std::string>& settings) {
  TrainConfig config;
  config.scene.path = o.scene;
  for (const std::string& setting : o.settings) apply_setting(config, setting);
  for (const std::string& setting : settings) apply_setting(config, setting);
  // The number of Gaussians grows in the first half.
  config.train.iterations = 2 * std::max(o.warm, o.block * (o.common.repeats + 1));
  check(config);
  return config;
}

// Where all kinds go on from.
struct Trained {
  HostModel model;
  Arrays state;
};

Trained warmed_up(Queue& queue, const StepOptions& o, const ScratchFolder& folder, bool quiet) {
  const TrainConfig config = configured(o, {});
  Preparation prepared(config, folder.file("frames"));
  prepared.compute_flow(folder.file("flow"), quiet);
  prepared.look_for_change();
  Model model(queue, prepared.first_model(queue));
  Trainer trainer = prepared.trainer(queue, model);
  Progress progress("train", o.warm, quiet);
  for (int step = 0; step < o.warm; ++step) {
    trainer.step(queue, step);
    progress.update(step + 1);
  }
  queue.finish();
  return {model.read(queue), trainer.state(queue)};
}

// What a step of a kind costs, the mean of each block of steps.
struct StepCost {
  std::vector<double> wall, cpu, busy;
  std::map<std::string, std::vector<double>> kernels;
  size_t gaussians = 0;
};

StepCost cost_of_steps(Queue& queue, const StepOptions& o, const Kind& kind, const Trained& from,
                       const ScratchFolder& folder) {
  const TrainConfig config = configured(o, kind.settings);
  Preparation prepared(config, folder.file("frames"));
  prepared.compute_flow(folder.file("flow"), true);
  prepared.look_for_change();
  Model model(queue, from.model);
  Trainer trainer = prepared.trainer(queue, model);
  trainer.set_state(queue, from.state, "the first training");
  StepCost cost;
  int step = o.warm;
  for (int k = -1; k < o.common.repeats; ++k) {  // the first block compiles and decodes
    queue.finish();
    queue.reset_timings();
    const auto start = std::chrono::steady_clock::now();
    const double cpu = cpu_seconds();
    for (const int end = step + o.block; step < end; ++step) trainer.step(queue, step);
    queue.finish();
    if (k < 0) continue;
    const double steps = o.block;
    cost.cpu.push_back(1e3 * (cpu_seconds() - cpu) / steps);
    const std::chrono::duration<double, std::milli> wall =
        std::chrono::steady_clock::now() - start;
    cost.wall.push_back(wall.count() / steps);
    double busy = 0;
    for (const auto& [name, timing] : queue.timings()) {
      cost.kernels[name].push_back(timing.total_ms / steps);
      busy += timing.total_ms / steps;
    }
    cost.busy.push_back(busy);
  }
  cost.gaussians = model.parameters.count;
  return cost;
}

void run_step(const StepOptions& o, const GlobalOptions& options) {
  QueueOptions queue_options;
  queue_options.profile = true;
  Queue queue = open_queue(options, queue_options);
  const ScratchFolder folder;
  const Trained from = warmed_up(queue, o, folder, options.quiet);
  Report report("step", queue, measure_peak(queue),
                {{"scene", o.scene}, {"steps before", o.warm}, {"repeats", o.common.repeats}});
  std::vector<StepCost> costs;
  for (const Kind& kind : kinds) costs.push_back(cost_of_steps(queue, o, kind, from, folder));
  const double pictures = spread_of(costs[0].cpu).median;
  for (size_t i = 0; i < kinds.size(); ++i) {
    const StepCost& c = costs[i];
    const Spread wall = spread_of(c.wall), busy = spread_of(c.busy), cpu = spread_of(c.cpu);
    report.add({kinds[i].name,
                {{"wall [ms]", wall},
                 {"CPU [ms]", cpu},
                 {"device busy [ms]", busy},
                 single("idle [%]", 100 * std::max(0.0, 1 - busy.median / wall.median)),
                 single("CPU, of pictures alone", cpu.median / pictures),
                 single("Gaussians", double(c.gaussians))}});
  }
  for (const size_t i : {0, 1}) {
    std::vector<std::pair<std::string, Spread>> rows;
    for (const auto& [name, times] : costs[i].kernels) rows.emplace_back(name, spread_of(times));
    std::sort(rows.begin(), rows.end(),
              [](const auto& a, const auto& b) { return a.second.median > b.second.median; });
    const double busy = spread_of(costs[i].busy).median;
    for (const auto& [name, ms] : rows)
      if (ms.median > 0.002 * busy)
        report.add({kinds[i].name + ": " + name,
                    {{"device [ms]", ms}, single("of the device's time [%]", 100 * ms.median / busy)}});
  }
  deliver(report, o.common);
}

}  // namespace

void add_step(CLI::App& bench, const GlobalOptions& options) {
  auto flags = std::make_shared<StepOptions>();
  CLI::App* step = bench.add_subcommand(
      "step", "Training steps on a scene: pictures alone, with flow, with each regulariser");
  step->add_option("SCENE", flags->scene, "Folder of the scene, or a video")
      ->required()
      ->type_name("PATH");
  step->add_option("--set", flags->settings, "A setting of training; may be repeated")
      ->type_name("SECTION.KEY=VALUE")
      ->expected(1)
      ->default_str("")
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll);
  step->add_option("--warm", flags->warm, "Steps of training before anything is measured")
      ->check(number_in(1, 1000000));
  step->add_option("--block", flags->block, "Steps that are timed together")
      ->check(number_in(1, 100000));
  add_common(*step, flags->common);
  step->callback([flags, &options] { run_step(*flags, options); });
}

}  // namespace gflow::bench
