// SPDX-License-Identifier: Apache-2.0
// Resuming and saving: which checkpoint may be continued, and the writing of checkpoints.
#pragma once
#include "optim/runs/run_folder.hpp"

namespace gflow {

// Fingerprint of the training data, independent of its location: cameras, times, and names and
// sizes of images.
std::string scene_stamp(const Scene& scene);

// Error if a setting that affects the result, the cameras or the images differ from those that the
// checkpoint was written with. Warns if the result will not be bitwise equal to that of an
// uninterrupted run.
void require_resumable(const CheckpointFolder::Found& found, const Queue& queue,
                       const TrainOptions& config, const Scene& scene, const RunFolder& run);

// The command that resumes a run, with the option that it needs if it starts a program.
std::string resuming_command(const RunFolder& run, const TrainOptions& config);
// Text for messages: "`gflow train -o RUN --resume` continues from there".
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
