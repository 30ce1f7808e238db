// SPDX-License-Identifier: Apache-2.0
// `gflow bench skip`: cost of each piece of skipped work (skip.*, motion.cutoff, flow.*), alone and
// all together, in training steps on a scene; and its effect on the result.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <memory>

#include "apps/bench/measure/steps.hpp"
#include "apps/common/command_line.hpp"
#include "runtime/base/interrupt.hpp"

namespace gflow::bench {
namespace {

constexpr char kEveryStep[] = "flow in every step (flow.every=1)";

// The default; without each skip in turn; without all exact skips (exact but for rounding); and
// without any. The others (flow.every, flow.low_motion, motion.cutoff) change what is trained, so
// their savings are not for the same work.
std::vector<Kind> kinds_of() {
  std::vector<Kind> kinds{{"all skips", {}}};
  Kind inexact{"no exact skip", {}}, none{"no skip at all", {}};
  Skips skips;
  Skips::fields(skips, [&](const std::string& name, bool&, const Help&) {
    const std::string off = fmt::format("skip.{}=false", name);
    kinds.push_back({fmt::format("without {}", name), {off}});
    none.settings.push_back(off);
    inexact.settings.push_back(off);
  });
  kinds.push_back({"at every time (motion.cutoff=0)", {"motion.cutoff=0"}});
  kinds.push_back({"flow in low-motion tiles too (flow.low_motion=1)", {"flow.low_motion=1"}});
  kinds.push_back({kEveryStep, {"flow.every=1"}});
  none.settings.insert(none.settings.end(),
                       {"motion.cutoff=0", "flow.low_motion=1", "flow.every=1"});
  kinds.push_back(inexact);
  kinds.push_back(none);
  return kinds;
}

// Flow in every second step is not a skip but another use of the time. So the saving of all skips
// is also reported for steps with flow every time.
std::string saved_by_all(const std::vector<Kind>& kinds, const std::vector<StepCost>& costs) {
  const auto every = std::find_if(kinds.begin(), kinds.end(),
                                  [](const Kind& kind) { return kind.name == kEveryStep; });
  const StepCost& all = costs[size_t(every - kinds.begin())];
  const Spread ratio = ratio_of(costs.back().cpu, all.cpu);
  return fmt::format(
      "with flow in every step both, no skip at all takes {:.2f} ({:.2f} - {:.2f}) times the CPU "
      "time of all skips",
      ratio.median, ratio.low, ratio.high);
}

// a - b| / |b| over all parameters; 0 only for equal bits.
double difference(const HostModel& a, const HostModel& b) {
  double apart = 0, length = 0;
  for (const auto& [name, values] : b.groups) {
    const std::vector<float>& others = a.groups.at(name);
    if (others.size() != values.size()) return INFINITY;
    for (size_t i = 0; i < values.size(); ++i) {
      const double d = double(others[i]) - double(values[i]);
      apart += d * d;
      length += double(values[i]) * double(values[i]);
    }
  }
  return apart == 0 ? 0 : std::sqrt(apart / length);
}

Result run_skip(StepOptions o, const GlobalOptions& options) {
  QueueOptions queue_options;
  queue_options.profile = true;
  Queue queue = open_queue(options, queue_options);
  const InterruptGuard guard;
  const ScratchFolder folder("bench");
  Report report("skip", queue,
                {{"scene", o.scene},
                 {"settings", o.settings},
                 {"steps before", o.warm},
                 {"block", o.block},
                 {"repeats", o.common.repeats}},
                o.common.compare);
  const Trained from = warmed_up(queue, o, folder, options.quiet);
  o = with_whole_blocks(o, from, options.quiet);
  const std::vector<Kind> kinds = kinds_of();
  const std::vector<StepCost> costs = costs_of_steps(queue, o, kinds, from, folder);
  for (size_t i = 0; i < kinds.size(); ++i) {
    const StepCost& c = costs[i];
    Row row{kinds[i].name,
            {{"wall [ms]", spread_of(c.wall)},
             {"CPU [ms]", spread_of(c.cpu)},
             {"CPU, of all skips", ratio_of(c.cpu, costs[0].cpu)},
             single("moved by Adam", c.work.touched.moved),
             single("listed", c.work.listed),
             single("posed", c.work.posed),
             single("posed at t2", c.work.posed_t2),
             single("drawn", c.work.touched.drawn),
             single("colour values", c.work.color_values),
             single("intersections", c.work.touched.intersections),
             single("tiles with flow", c.work.tiles_with_flow),
             single("in the backward pass", c.work.tiles_back),
             single("bytes [1e6]", 1e-6 * bytes_of(c.work.touched)),
             single("pairs in cells", c.work.pairs.masked),
             single("pairs back", c.work.pairs.back),
             single("pairs blended", c.work.pairs.blended),
             single("model differs by", difference(c.end, costs[0].end))}};
    for (Measurement& share : shares_of_peaks(c, report.peak()))
      row.measurements.push_back(std::move(share));
    report.add(std::move(row));
  }
  report.note(saved_by_all(kinds, costs));
  report.note(blocks_of(o));
  report.note(fmt::format("models are compared after {} steps of each kind",
                          o.timed * (repeats_a_making(o) + 1)));
  report.measure_peak_again(queue);
  return {std::move(report), {plot_of("skip", kinds, costs)}};
}

}  // namespace

void add_skip(CLI::App& bench, const GlobalOptions& options) {
  auto flags = std::make_shared<StepOptions>();
  CLI::App* skip = bench.add_subcommand(
      "skip",
      "Training steps on a scene without each of the settings skip.*, motion.cutoff, "
      "flow.low_motion and flow.every; then without the exact ones (skip.*), and without all");
  add_step_options(*skip, *flags);
  skip->callback(
      [flags, &options] { deliver(flags->common, [&] { return run_skip(*flags, options); }); });
}

}  // namespace gflow::bench
