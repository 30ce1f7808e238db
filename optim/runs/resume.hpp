// SPDX-License-Identifier: Apache-2.0
// Resuming and saving: which checkpoint may be continued, and the writing of checkpoints.
#pragma once
#include "optim/runs/run_folder.hpp"

namespace gflow {

// The checkpoint to continue from; none if the run has no checkpoint yet, which is printed unless
// quiet. Warns if the result will not be bitwise equal to that of an uninterrupted run. Error if
// there are checkpoints and none is readable, or if a setting that affects the result, the cameras
// or the images differ from those of the run.
std::optional<CheckpointFolder::Found> checkpoint_to_resume(const Queue& queue,
                                                            const TrainOptions& config,
                                                            const Scene& scene,
                                                            const RunFolder& run, bool quiet);

// Error if the folder holds a training run, finished or stopped early.
void require_no_training(const RunFolder& run);

// Text for messages: "`gflow train -o RUN --resume` goes on from there", with the option that a run
// needs if it starts a program.
std::string how_to_resume(const RunFolder& run, const TrainOptions& config);

// Writes the checkpoints of one training run; all references must outlive it.
class Checkpointer {
 public:
  Checkpointer(Queue& queue, const TrainOptions& config, const Scene& scene, const RunFolder& run,
               Trainer& trainer, const ModelShape& shape);
  // Writes a checkpoint after `step` steps that took `seconds`. Waits.
  void write(int step, double seconds);
  // Warns instead of throwing, because the training is still worth finishing and there may be room
  // later.
  void try_write(int step, double seconds);
  // The same to any file, which is not used for resuming.
  void write_to(const std::string& path, int step);

 private:
  Queue& queue_;
  CheckpointFolder folder_;
  Trainer& trainer_;
  CheckpointFacts facts_;
};

}  // namespace gflow
