// SPDX-License-Identifier: Apache-2.0
// Timed training steps: a training is started once, and several continuations are compared over the
// same views.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "apps/bench/bench.hpp"
#include "apps/bench/measure/pairs.hpp"
#include "optim/train/preparation.hpp"
#include "runtime/files/temporary_folder.hpp"

namespace gflow::bench {

struct StepOptions {
  BenchOptions common;
  std::string scene;                  // folder or video
  std::vector<std::string> settings;  // of all kinds, "section.key=value"
  int warm = 1500, block = 20;        // steps before timing, and approximate steps per timed block
  // Set by with_whole_blocks(). timed: steps per timed block. counted: steps whose work is counted,
  // the period after which the same kinds of step recur (whole images or parts, flow, motion loss).
  int timed = 20, counted = 1;
};
// Adds the options to a sub-command.
void add_step_options(CLI::App& bench, StepOptions& options);

// A continuation: its name and changed settings; optionally its own queue (other number of lanes).
struct Kind {
  std::string name;
  std::vector<std::string> settings;
  std::function<void(TrainOptions&)> change = {};  // applied after the settings
  Queue* queue = nullptr;
};

// The common starting point of all kinds.
struct Trained {
  HostModel model;
  Arrays state;
};
Trained warmed_up(Queue& queue, const StepOptions& o, const ScratchFolder& folder, bool quiet);

// Mean work of a step over the same steps for all kinds (StepOptions::counted).
struct StepWork {
  double listed = 0;  // rows that the view may show (skip.culled); only these are posed
  double posed = 0, posed_t2 = 0;              // Gaussians posed at the first and second time
  double tiles_with_flow = 0, tiles_back = 0;  // drawn with flow; with flow gradients
  double color_values = 0;                     // read to compute colours
  Touched touched;
  Pairs pairs;
};

// Cost of a step of one kind, averaged per block, and the work of the last steps.
struct StepCost {
  Samples wall, cpu, busy, host;  // [ms]; busy: of the device; host: of the training thread
  KernelSamples kernels;          // [ms] on the device
  HostModel end;
  StepWork work;
};
// Number of times a training is set up again while it is timed: step times differ by up to 8 %
// between set-ups, possibly because of where buffers are in memory.
constexpr int kMakings = 3;
// Repeats per set-up; in total at least as many as requested.
int repeats_a_making(const StepOptions& o);
// Rounds the block length up so that each block has the same number of steps with flow (flow.every,
// depending on the model) and other periodic work; prints a message if it becomes longer.
StepOptions with_whole_blocks(StepOptions o, const Trained& from, bool quiet);
// A note about the blocks for the report.
std::string blocks_of(const StepOptions& o);
// Costs of all kinds: in every repeat a block of the same steps for each, in the order of order_of.
std::vector<StepCost> costs_of_steps(Queue& queue, const StepOptions& o,
                                     const std::vector<Kind>& kinds, const Trained& from,
                                     const ScratchFolder& folder);

// Of the wall time of a step, as shares of the device's peaks: the operations of blending colours
// forward and backward, and the bytes touched (pairs.hpp).
std::vector<Measurement> shares_of_peaks(const StepCost& cost, const Peak& peak);
// A bar of CPU time per kind, with its quartiles.
Plot plot_of(const std::string& name, const std::vector<Kind>& kinds,
             const std::vector<StepCost>& costs);

}  // namespace gflow::bench
