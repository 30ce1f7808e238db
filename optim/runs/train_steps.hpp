// SPDX-License-Identifier: Apache-2.0
// The training loop of a run: steps with progress, log, models and checkpoints, until the plan, the
// clock or the user ends it.
#pragma once
#include <chrono>
#include <functional>
#include <optional>

#include "optim/eval/validation.hpp"
#include "optim/runs/resume.hpp"
#include "optim/train/train_loop.hpp"
#include "runtime/base/interrupt.hpp"

namespace gflow {

// Training time, including that of earlier processes.
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

// Parts of a training run; everything that it refers to must outlive it.
struct Training {
  Queue& queue;
  const TrainOptions& config;
  const RunFolder& run;
  Model& model;
  Trainer& trainer;
  Checkpointer& checkpoints;
  Stopwatch watch;
  Validation validation;
  FrameStore& frames;                 // whose cameras training may correct
  TrainObserver* observer = nullptr;  // called after each step that is kept; nullptr: none
};

// Action after the first step of this process: the run takes over the folder.
struct FirstStep {
  std::function<void()> then;  // may be empty
  // The folder holds a previous run, which stays until a step has finite values. Until then the
  // time limit is ignored, and errors do not mention saved steps.
  bool replaces = false;
  // The initial model took long to make, so the run gets a checkpoint as soon as it has the folder:
  // of step 0, or if it replaces another run of its first sound step.
  bool saves = false;
};

// Makes the steps from number `step` on; returns the number of steps made, earlier ones included.
// Sets `guard` after the first one, which may compile kernels for long; before it there is nothing
// to save. Error, which says how many steps are saved, if guidance or device fail, an input cannot
// be read, or the loss stays non-finite (RollBack).
int train_steps(Training& training, int step, std::optional<InterruptGuard>& guard, bool quiet,
                FirstStep first);

// Removes the model of the step at which an earlier process was stopped, unless train.save_every
// asks for it; `steps` were made since.
void remove_model_of_stop(const RunFolder& run, const TrainOptions& config, int stopped, int steps);

// Writes the result after `steps` steps: model, facts about the run, and a checkpoint.
RunFacts keep_result(Training& training, int steps);

}  // namespace gflow
