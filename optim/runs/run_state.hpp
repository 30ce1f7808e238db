// SPDX-License-Identifier: Apache-2.0
// What a run has come to: the one place that decides which model commands show of it, while it is
// trained, after it was stopped or killed, and when it is finished.
#pragma once
#include <cstdint>
#include <string>

#include "optim/runs/run_folder.hpp"

namespace gflow {

constexpr int latest_iteration = -1;

struct RunState {
  int iteration = 0;        // training steps behind the model
  bool checkpoint = false;  // whether it comes from a checkpoint, else from a point cloud
  std::string path;         // of the file that held it
  uintmax_t bytes = 0;      // its length; a training may have replaced it by now
  HostModel model;
  TrainOptions config;  // of the run
  RunFacts facts;       // of `iteration` steps; NaN and "" where nobody knows

  // "iteration 1200 of 3000, from the checkpoint"
  std::string text() const;
};

// The shape of the models of a training: as its checkpoint says or, one of an older gflow, its
// first Gaussians. `path`: the checkpoint's. Error when neither does.
ModelShape kept_shape(const Checkpoint& checkpoint, const std::string& path, const RunFolder& run);

// Iterations that a run has a point cloud or a checkpoint of, rising.
std::vector<int> iterations_of(const RunFolder& run);

// The state of the highest iteration, a point cloud before a checkpoint of the same, or that of one
// iteration. Takes no lock: beside a training that replaces what is read, it is the state before or
// after. Warns of damaged files where another one can be used. Error when there is no state, or no
// such iteration, with those there are.
RunState read_run_state(const RunFolder& run, int iteration = latest_iteration);

}  // namespace gflow
