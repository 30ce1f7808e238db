// SPDX-License-Identifier: Apache-2.0
// Roll-back after a divergence: training with non-finite values returns to its last checkpoint and
// continues with half the learning rates.
#pragma once
#include <optional>

#include "optim/runs/resume.hpp"
#include "optim/train/trainer.hpp"

namespace gflow {

// Whether training may continue with this report: loss and learned values are finite, since
// `before` at most one Gaussian in a thousand (plus ten) had rejected gradients, and no shared row
// is stuck. A few Gaussians that cannot learn are no reason to roll back.
bool is_finite_report(const StepReport& now, const StepReport& before);

// Describes the non-finite values of a report at a step.
std::string what_is_non_finite(const StepReport& report, int step);

class RollBack {
 public:
  static constexpr int most = 3;  // consecutive returns to one checkpoint

  RollBack(Queue& queue, const RunFolder& run, Trainer& trainer, Checkpointer& checkpoints)
      : queue_(queue), run_(run), trainer_(trainer), checkpoints_(checkpoints) {}

  // Restores the last checkpoint, with half of the latest learning-rate scale, and describes it in
  // `notice`. Returns the checkpoint's step. Error if there is none, or after `most` times; then
  // broken.npz in the run contains the diverged state.
  int roll_back(int step, const StepReport& report, std::string& notice);

  // Saves the state after `step` steps if the next step ran out of memory, and if the values that
  // need no image are finite: `before` as for is_finite_report().
  void save_if_finite(int step, double seconds, const std::optional<StepReport>& before);

 private:
  Queue& queue_;
  const RunFolder& run_;
  Trainer& trainer_;
  Checkpointer& checkpoints_;
  int times_ = 0, from_ = -1;
};

}  // namespace gflow
