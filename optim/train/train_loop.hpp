// SPDX-License-Identifier: Apache-2.0
// The training loop, and the observer interface for logs, checkpoints, viewers and scripts.
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "optim/train/trainer.hpp"
#include "runtime/base/report.hpp"
#include "runtime/base/warning.hpp"

namespace gflow {

// State of a training run after a step.
class TrainState {
 public:
  TrainState(Queue& queue, Trainer& trainer, int done, int steps)
      : queue(queue), trainer(trainer), done(done), steps(steps) {}

  // Loss, terms and counts of the last step; read from the device on the first call. Waits.
  const StepReport& report();
  // The model on the device; valid during the call.
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
  // Before the first step, while optical flow is computed: numbers of image pairs done and of all.
  // Called from any thread, one call at a time.
  virtual void on_flow(size_t /*done*/, size_t /*pairs*/) {}
  // After each step. An exception ends the training.
  virtual void after_step(TrainState&) {}
  // A message to the user: about an event in a step, or a warning, which may come from any thread.
  virtual void on_notice(const std::string&) {}
  // false: warnings stay on stderr, and on_notice() gets the events only.
  virtual bool takes_warnings() const { return true; }
  // Called before each step, with `done` steps made; true ends the training.
  virtual bool stop(int done) {
    (void)done;
    return false;
  }
};

// Reports the steps that a training has made, to a progress line for example.
class StepCounter : public TrainObserver {
 public:
  StepCounter(ProgressCallback report, size_t steps) : report_(std::move(report)), steps_(steps) {}
  void after_step(TrainState& state) override { report_(size_t(state.done), steps_); }

 private:
  ProgressCallback report_;
  size_t steps_;
};

// Additions of a caller to a training run.
struct TrainExtensions {
  TrainObserver* observer = nullptr;      // nullptr: none
  std::vector<MakeObjective> objectives;  // after gflow's own
  Seat* seat = nullptr;  // train_run: of the leader of several devices; nullptr: one trains alone
};

// Sends warnings to the observer while the result exists; nullptr, or one that takes none: they
// stay on stderr.
std::unique_ptr<WarningsTo> warnings_to(TrainObserver* observer);

// Makes steps first, first + 1, ..., steps - 1 unless the observer stops; returns the number of
// steps made, the `first` earlier ones included.
int train_loop(Queue& queue, Trainer& trainer, int first, int steps, TrainObserver& observer);

}  // namespace gflow
