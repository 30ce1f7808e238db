// SPDX-License-Identifier: Apache-2.0
// `gflow bench step`: whole training steps on a scene, with and without optional losses beside the
// image loss.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>

#include "apps/bench/measure/steps.hpp"
#include "apps/common/command_line.hpp"
#include "runtime/base/interrupt.hpp"

namespace gflow::bench {
namespace {

const std::vector<Kind> kinds{
    {"images only", {"flow.enabled=false"}},
    {"with flow", {}},
    {"flow in every step", {"flow.every=1"}},
    {"flow in low-motion tiles too", {"flow.low_motion=1"}},
    {"flow in all tiles in every step", {"flow.every=1", "flow.low_motion=1"}},
    {"flow, rigidity", {"loss.rigidity=1"}},
    {"flow, rotation", {"loss.rotation=1"}},
    {"flow, isometry", {"loss.isometry=1"}},
    {"flow, velocity", {"loss.velocity=1"}},
    {"flow, acceleration", {"loss.acceleration=1"}}};

Result run_step(StepOptions o, const GlobalOptions& options) {
  QueueOptions queue_options;
  queue_options.profile = true;
  Queue queue = open_queue(options, queue_options);
  const InterruptGuard guard;
  const ScratchFolder folder("bench");
  Report report("step", queue,
                {{"scene", o.scene},
                 {"settings", o.settings},
                 {"steps before", o.warm},
                 {"block", o.block},
                 {"repeats", o.common.repeats}},
                o.common.compare);
  const Trained from = warmed_up(queue, o, folder, options.quiet);
  o = with_whole_blocks(o, from, options.quiet);
  const std::vector<StepCost> costs = costs_of_steps(queue, o, kinds, from, folder);
  for (size_t i = 0; i < kinds.size(); ++i) {
    const StepCost& c = costs[i];
    Samples idle;
    for (size_t k = 0; k < c.wall.size(); ++k)
      idle.push_back(100 * std::max(0.0, 1 - c.busy[k] / c.wall[k]));
    Row row{kinds[i].name,
            {{"wall [ms]", spread_of(c.wall)},
             {"CPU [ms]", spread_of(c.cpu)},
             {"device busy [ms]", spread_of(c.busy)},
             {"host [ms]", spread_of(c.host)},
             {"idle [%]", spread_of(idle)},
             {"CPU, relative to images only", ratio_of(c.cpu, costs[0].cpu)},
             single("Gaussians", double(c.end.count))}};
    for (Measurement& share : shares_of_peaks(c, report.peak()))
      row.measurements.push_back(std::move(share));
    report.add(std::move(row));
  }
  for (const size_t i : {0, 1}) {
    std::vector<Row> rows;
    for (const auto& [name, times] : costs[i].kernels)
      rows.push_back(
          {kinds[i].name + ": " + name,
           {{"device [ms]", spread_of(times)},
            queue.info.is_cpu ? Measurement{"CPU, about [ms]",
                                            spread_of(cpu_of(times, costs[i].busy, costs[i].cpu))}
                              : single("CPU, about [ms]", NAN),
            {"of the device's time [%]", scaled(ratio_of(times, costs[i].busy), 100)}},
           is_brief(times, costs[i].busy)});
    std::sort(rows.begin(), rows.end(), [](const Row& a, const Row& b) {
      return a.measurements[0].value.median > b.measurements[0].value.median;
    });
    for (Row& row : rows) report.add(std::move(row));
  }
  report.note(blocks_of(o));
  report.measure_peak_again(queue);
  return {std::move(report), {plot_of("step", kinds, costs)}};
}

}  // namespace

void add_step(CLI::App& bench, const GlobalOptions& options) {
  auto flags = std::make_shared<StepOptions>();
  CLI::App* step =
      bench.add_subcommand("step",
                           "Training steps on a scene: images only, with flow, flow in every step, "
                           "flow in low-motion tiles too, both, with each regulariser");
  add_step_options(*step, *flags);
  step->callback(
      [flags, &options] { deliver(flags->common, [&] { return run_step(*flags, options); }); });
}

}  // namespace gflow::bench
