// SPDX-License-Identifier: Apache-2.0
// Between the training loop and its checkpoints: which one may be gone on from, and the saving.
#pragma once
#include "optim/runs/run_folder.hpp"

namespace gflow {

// The checkpoint to go on from; none when the run has not come to one, which is said unless quiet.
// Warns where the result will not be bit by bit that of a training without a stop. Error when there
// are checkpoints and none can be read, or when a setting that the result depends on, the cameras
// or the pictures are not those the training was begun with.
std::optional<CheckpointFolder::Found> checkpoint_to_resume(const Queue& queue,
                                                            const TrainOptions& config,
                                                            const Scene& scene,
                                                            const RunFolder& run, bool quiet);

// Error when the folder holds a training, finished or stopped before its end.
void require_no_training(const RunFolder& run);

// "`gflow train -o RUN --resume` goes on from there", with the option that a run needs which starts
// a program.
std::string how_to_resume(const RunFolder& run, const TrainOptions& config);

// Writes the checkpoints of one training; all references must outlive it.
class Checkpointer {
 public:
  Checkpointer(Queue& queue, const TrainOptions& config, const Scene& scene, const RunFolder& run,
               Trainer& trainer, const ModelShape& shape);
  // After `step` steps that took so many seconds. Waits.
  void write(int step, double seconds);
  // Warns instead of throwing: a training that cannot be saved is worth finishing, and there may be
  // room later.
  void try_write(int step, double seconds);
  // The same in any file, which no training goes on from.
  void write_to(const std::string& path, int step);

 private:
  Queue& queue_;
  CheckpointFolder folder_;
  Trainer& trainer_;
  CheckpointFacts facts_;
};

}  // namespace gflow
