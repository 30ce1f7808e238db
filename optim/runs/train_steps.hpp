// SPDX-License-Identifier: Apache-2.0
// The training loop: its steps with progress, log, models and checkpoints on the way, until the
// plan, the clock or the user ends them.
#pragma once
#include <chrono>
#include <functional>
#include <optional>

#include "optim/runs/resume.hpp"
#include "optim/train/train_loop.hpp"
#include "runtime/base/interrupt.hpp"

namespace gflow {

// Training time, that of earlier processes included.
class Stopwatch {
 public:
  explicit Stopwatch(double before) : before_(before) {}
  double seconds() const {
    return before_ + std::chrono::duration<double>(Clock::now() - start_).count();
  }

 private:
  using Clock = std::chrono::steady_clock;
  double before_;
  Clock::time_point start_ = Clock::now();
};

// What a training is made of; all that it refers to outlives it.
struct Training {
  Queue& queue;
  const TrainOptions& config;
  const RunFolder& run;
  Model& model;
  Trainer& trainer;
  Checkpointer& checkpoints;
  Stopwatch watch;
  TrainObserver* observer = nullptr;  // follows each step that is kept; nullptr: nobody does
};

// What the first step of a training is followed by, where there is one: the folder becomes its own.
struct FirstStep {
  std::function<void()> then;  // or none: it is already
  // The folder holds another training, which stays until the step has figures and these are sound:
  // the clock does not end this one before, and an error until then says nothing of what is saved.
  bool replaces = false;
};

// Makes the steps from number `step` on; returns the number of steps made, earlier ones included.
// Sets `guard` after the first one, in which kernels may be compiled for long: before it there is
// nothing to save. Error, which says how many steps are saved, when guidance or device fail, what a
// step needs cannot be read, or the loss stays no number (RollBack).
int train_steps(Training& training, int step, std::optional<InterruptGuard>& guard, bool quiet,
                FirstStep first);

// Writes what it came to after so many steps: the model, facts about the run, a checkpoint.
RunFacts keep_result(Training& training, int steps);

}  // namespace gflow
