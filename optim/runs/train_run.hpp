// SPDX-License-Identifier: Apache-2.0
// The whole job: a scene folder in, a run folder out. Scripts and the command line both call this.
#pragma once
#include <string>
#include <vector>

#include "optim/runs/run_state.hpp"
#include "optim/scene/loaded_scene.hpp"
#include "optim/train/train_loop.hpp"

namespace gflow {

// anew: Error when there is a training in the run folder. overwrite: it is replaced. resume: it is
// continued from its last checkpoint, or as anew where it had not come to one.
enum class Start { anew, overwrite, resume };

// Trains config.scene.path into `run`, writing as it goes; evaluates on the test views at the end.
// On Ctrl-C the step is finished, checkpoint and model written, and Interrupted thrown; before the
// first step and while it evaluates, a signal does what it does elsewhere (StopSentence). A
// training that was stopped, in whichever way, and resumed gives the bits of one that was not.
// Error when another process writes the folder, and when there is a checkpoint and settings or
// scene are not its own. extensions: objectives and an observer of the caller's.
Evaluation train_run(Queue& queue, const TrainOptions& config, const RunFolder& run, bool quiet,
                     Start start = Start::anew, const TrainExtensions& extensions = {});

}  // namespace gflow
