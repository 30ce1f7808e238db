// SPDX-License-Identifier: Apache-2.0
// The training loop, and the seam for whoever follows it: log, checkpoints, viewers, scripts.
#pragma once
#include <optional>
#include <string>

#include "optim/train/trainer.hpp"

namespace gflow {

// A training after one of its steps.
class TrainState {
 public:
  TrainState(Queue& queue, Trainer& trainer, int done, int steps)
      : queue(queue), trainer(trainer), done(done), steps(steps) {}

  // Loss, terms and counts of the step just made; read from the device on the first call. Waits.
  const StepReport& report();
  // The model as it is on the device; valid during the call.
  const Model& model() const { return trainer.model(); }

  Queue& queue;
  Trainer& trainer;
  int done;         // steps made; an observer that restores an earlier state sets it back
  const int steps;  // steps planned

 private:
  std::optional<StepReport> report_;
};

class TrainObserver {
 public:
  virtual ~TrainObserver() = default;
  // After each step. An exception ends the training.
  virtual void after_step(TrainState&) {}
  // A sentence for the user about something that happened in a step.
  virtual void on_notice(const std::string&) {}
  // Asked before each step, of which `done` are made: true ends the training.
  virtual bool stop(int done) {
    (void)done;
    return false;
  }
};

// What a caller adds to a training.
struct TrainExtensions {
  TrainObserver* observer = nullptr;      // nullptr: nobody follows
  std::vector<MakeObjective> objectives;  // after gflow's own
};

// Makes steps first, first + 1, ... of options.train.iterations; returns the number of steps made,
// `first` included.
int train_loop(Queue& queue, Trainer& trainer, int first, int steps, TrainObserver& observer);

}  // namespace gflow
