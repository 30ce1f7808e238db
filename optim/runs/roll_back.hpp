// SPDX-License-Identifier: Apache-2.0
// A training whose figures stop being numbers goes back to its last checkpoint and learns more
// slowly from there (numerics 3, "non-finite loss").
#pragma once
#include <optional>

#include "optim/runs/resume.hpp"
#include "optim/train/trainer.hpp"

namespace gflow {

// Whether a training with these figures is worth going on with: its loss and all that it has
// learned are numbers, since the figures before no more rows than one Gaussian in a thousand (and
// ten more) had gradients that Adam could not take, and nothing that all share is stuck with them.
// (A Gaussian that cannot learn is no reason to give up the others.)
bool is_finite_report(const StepReport& now, const StepReport& before);

// Of figures that are not sound, in words: what it is at that step.
std::string what_is_non_finite(const StepReport& figures, int step);

class RollBack {
 public:
  static constexpr int most = 3;  // times in a row from one checkpoint

  RollBack(Queue& queue, const RunFolder& run, Trainer& trainer, Checkpointer& checkpoints)
      : queue_(queue), run_(run), trainer_(trainer), checkpoints_(checkpoints) {}

  // Puts the trainer where the last checkpoint was, with half the learning rates it had last; says
  // so in `notice`. Returns that step. Error when there is none, or after `most` times: then
  // broken.npz in the run holds the state that the training came to.
  int roll_back(int step, const StepReport& figures, std::string& notice);

  // Saves the state after `step` steps, when the next one failed for want of memory, if it is sound
  // as far as can be seen without an image: `before` as for is_finite_report().
  void save_if_finite(int step, double seconds, const std::optional<StepReport>& before);

 private:
  Queue& queue_;
  const RunFolder& run_;
  Trainer& trainer_;
  Checkpointer& checkpoints_;
  int times_ = 0, from_ = -1;
};

}  // namespace gflow
