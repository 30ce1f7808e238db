// SPDX-License-Identifier: Apache-2.0
// What a training run does with the folder it is given: decided once, from what the folder
// contains.
#pragma once
#include <optional>
#include <string>

#include "optim/runs/run_folder.hpp"

namespace gflow {

// fresh: Error if the run folder holds a training; warns if one was begun in it. overwrite:
// replaces it. resume: continues from its last checkpoint, or starts fresh if there is none.
enum class Start { fresh, overwrite, resume };

struct RunPlan {
  enum Kind {
    fresh,    // the folder is new, or nothing in it is worth keeping
    replace,  // trains from the first step; the previous run stays until the first step is sound
    resume,   // continues from the checkpoint
    only_evaluate,  // all steps are made: saves what is missing, and evaluates the model
  };
  Kind kind = fresh;
  std::optional<CheckpointFolder::Found> checkpoint;  // the last one of the run to resume

  bool starts_fresh() const { return kind == fresh || kind == replace; }
};

// Error if the run may not be replaced, or if there are checkpoints to resume from and none is
// readable.
RunPlan plan_run(const RunFolder& run, const TrainOptions& config, Start start);

// Where a resumed run starts, as a message.
std::string in_words(const RunPlan& plan, const RunFolder& run);

// Error if the folder holds a training, finished or stopped early.
void require_no_training(const RunFolder& run);

}  // namespace gflow
