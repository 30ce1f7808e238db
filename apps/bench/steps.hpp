// SPDX-License-Identifier: Apache-2.0
// Training steps that are timed: a training is begun once, and several ways to go on from there are
// compared over the same views.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "apps/bench/bench.hpp"
#include "apps/bench/pairs.hpp"
#include "optim/train/preparation.hpp"
#include "runtime/files/temporary_folder.hpp"

namespace gflow::bench {

struct StepOptions {
  BenchOptions common;
  std::string scene;                  // folder or video
  std::vector<std::string> settings;  // of all ways, "section.key=value"
  int warm = 1500, block = 20;        // steps before, and steps to be timed together, about
  // By with_whole_blocks(): steps that are timed together, and steps whose work is counted: after
  // so many the same kinds of step come again (whole pictures or parts, flow, a motion loss).
  int timed = 20, counted = 1;
};
// Adds them to a sub-command.
void add_step_options(CLI::App& bench, StepOptions& options);

// A way to go on: a name and what it changes of the settings; on a queue of its own (other lanes),
// or on that of the others.
struct Kind {
  std::string name;
  std::vector<std::string> settings;
  std::function<void(TrainConfig&)> change = {};  // after the settings
  Queue* queue = nullptr;
};

// Where all kinds go on from.
struct Trained {
  HostModel model;
  Arrays state;
};
Trained warmed_up(Queue& queue, const StepOptions& o, const ScratchFolder& folder, bool quiet);

// What a step works on, in the mean over the same steps of all kinds (StepOptions::counted).
struct StepWork {
  double listed = 0;  // rows that the views may show (skip.outside), for which all else is made
  double posed = 0, posed_t2 = 0;              // Gaussians whose shape at the times drawn was made
  double tiles_with_flow = 0, tiles_back = 0;  // drawn with it; through which its gradient goes
  double color_values = 0;                     // that are read to know the colours
  Touched touched;
  Pairs pairs;
};

// What a step of a kind costs, the mean of each block of steps, and what the last ones did.
struct StepCost {
  Samples wall, cpu, busy, host;  // [ms]; busy: the device; host: the training thread
  KernelSamples kernels;          // [ms] on the device
  HostModel end;
  StepWork work;
};
// A training is made anew so often while it is timed: what it takes differs by up to 8 % from one
// making to the next, for as long as it is there (where its buffers lie in memory, perhaps).
constexpr int kMakings = 3;
// Repeats of one making; together they are at least as many as asked for.
int repeats_a_making(const StepOptions& o);
// With blocks as long as asked for or a little longer, so that each holds as many steps with flow
// (flow.every, by the model); says so where they are longer.
StepOptions with_whole_blocks(StepOptions o, const Trained& from, bool quiet);
// What is told of them beside the figures.
std::string blocks_of(const StepOptions& o);
// Of all kinds, a block of the same steps of each in every repeat, in the order of order_of.
std::vector<StepCost> costs_of_steps(Queue& queue, const StepOptions& o,
                                     const std::vector<Kind>& kinds, const Trained& from,
                                     const ScratchFolder& folder);

// Of the wall time of a step: what colours alone take of blending there and back, and the bytes
// that it touches (pairs.hpp), as shares of what the device can do.
std::vector<Figure> shares_of_peaks(const StepCost& cost, const Peak& peak);
// A bar of CPU time for each kind, with its quartiles.
Plot plot_of(const std::string& name, const std::vector<Kind>& kinds,
             const std::vector<StepCost>& costs);

}  // namespace gflow::bench
