// SPDX-License-Identifier: Apache-2.0
// State of a run: the one place that decides which model commands show, while it is trained, after
// it was stopped or killed, and when it is finished.
#pragma once
#include <cstdint>
#include <string>

#include "optim/runs/run_folder.hpp"

namespace gflow {

constexpr int latest_iteration = -1;

struct RunState {
  int iteration = 0;        // training steps of the model
  bool checkpoint = false;  // from a checkpoint; else from a point cloud
  std::string path;         // file that the state was read from
  uintmax_t bytes = 0;      // size of the file, which training may have replaced by now
  HostModel model;
  TrainOptions config;  // settings of the run
  RunFacts facts;       // after `iteration` steps; NaN and "" if unknown

  // "iteration 1200 of 3000, from the checkpoint"
  std::string text() const;
};

// The model shape of a training run: from its checkpoint, or for one of an older gflow from its
// initial Gaussians. `path`: the checkpoint's. Error if neither has it.
ModelShape kept_shape(const Checkpoint& checkpoint, const std::string& path, const RunFolder& run);

// Iterations with a point cloud or a checkpoint, ascending.
std::vector<int> iterations_of(const RunFolder& run);

// Reads the state of the highest iteration, a point cloud before a checkpoint of the same; or of a
// given iteration. Takes no lock: if training replaces files meanwhile, the result is the state
// before or after. Warns of damaged files if another one is usable. Error, which lists the existing
// iterations, if there is no state or no such iteration.
RunState read_run_state(const RunFolder& run, int iteration = latest_iteration);

}  // namespace gflow
