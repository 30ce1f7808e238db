// SPDX-License-Identifier: Apache-2.0
// Complete training run: from a scene folder to a run folder. Used by scripts and the command line.
#pragma once
#include <string>
#include <vector>

#include "optim/runs/run_plan.hpp"
#include "optim/runs/run_state.hpp"
#include "optim/scene/loaded_scene.hpp"
#include "optim/train/train_loop.hpp"

namespace gflow {

// Trains config.scene.path into `run`, writing as it goes; evaluates on the test views at the end.
// Ctrl-C finishes the current step, writes checkpoint and model, and throws Interrupted; before the
// first step and during evaluation, signals act as elsewhere (StopSentence). A run that was stopped
// in any way and resumed is bitwise equal to an uninterrupted one. Error if another process writes
// the folder, or if there is a checkpoint with other settings or another scene. extensions:
// objectives and an observer of the caller, which then receives the warnings instead of stderr.
Evaluation train_run(Queue& queue, const TrainOptions& config, const RunFolder& run, bool quiet,
                     Start start = Start::fresh, const TrainExtensions& extensions = {});

}  // namespace gflow
