// SPDX-License-Identifier: Apache-2.0
// `gflow bench step`: whole training steps on a scene, with and without what training may ask for
// beside the pictures.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>

#include "apps/bench/steps.hpp"
#include "apps/command_line.hpp"
#include "optim/io/interrupt.hpp"

namespace gflow::bench {
namespace {

const std::vector<Kind> kinds{
    {"pictures alone", {"flow.enabled=false"}},     {"with flow", {}},
    {"flow in every step", {"flow.every=1"}},       {"flow of calm tiles too", {"flow.calm=1"}},
    {"flow, rigidity", {"loss.rigidity=1"}},        {"flow, rotation", {"loss.rotation=1"}},
    {"flow, isometry", {"loss.isometry=1"}},        {"flow, velocity", {"loss.velocity=1"}},
    {"flow, acceleration", {"loss.acceleration=1"}}};

void run_step(const StepOptions& o, const GlobalOptions& options) {
  check_outputs(o.common);
  QueueOptions queue_options;
  queue_options.profile = true;
  Queue queue = open_queue(options, queue_options);
  const InterruptGuard guard;
  const ScratchFolder folder;
  const Trained from = warmed_up(queue, o, folder, options.quiet);
  Report report("step", queue, measure_peak(queue),
                {{"scene", o.scene},
                 {"settings", o.settings},
                 {"steps before", o.warm},
                 {"block", o.block},
                 {"repeats", o.common.repeats}});
  const std::vector<StepCost> costs = costs_of_steps(queue, o, kinds, from, folder);
  const double pictures = spread_of(costs[0].cpu).median;
  for (size_t i = 0; i < kinds.size(); ++i) {
    const StepCost& c = costs[i];
    const Spread wall = spread_of(c.wall), busy = spread_of(c.busy), cpu = spread_of(c.cpu);
    report.add({kinds[i].name,
                {{"wall [ms]", wall},
                 {"CPU [ms]", cpu},
                 {"device busy [ms]", busy},
                 {"host [ms]", spread_of(c.host)},
                 single("idle [%]", 100 * std::max(0.0, 1 - busy.median / wall.median)),
                 single("CPU, of pictures alone", cpu.median / pictures),
                 single("Gaussians", double(c.end.count))}});
  }
  for (const size_t i : {0, 1}) {
    std::vector<std::pair<std::string, Spread>> rows;
    for (const auto& [name, times] : costs[i].kernels) rows.emplace_back(name, spread_of(times));
    std::sort(rows.begin(), rows.end(),
              [](const auto& a, const auto& b) { return a.second.median > b.second.median; });
    const double busy = spread_of(costs[i].busy).median;
    for (const auto& [name, ms] : rows)
      report.add(
          {kinds[i].name + ": " + name,
           {{"device [ms]", ms}, single("of the device's time [%]", 100 * ms.median / busy)}});
  }
  deliver(report, o.common, plot_of("step", kinds, costs));
}

}  // namespace

void add_step(CLI::App& bench, const GlobalOptions& options) {
  auto flags = std::make_shared<StepOptions>();
  CLI::App* step = bench.add_subcommand("step",
                                        "Training steps on a scene: pictures alone, with flow, in "
                                        "every step, of calm tiles too, with each regulariser");
  add_step_options(*step, *flags);
  step->callback([flags, &options] { run_step(*flags, options); });
}

}  // namespace gflow::bench
