// SPDX-License-Identifier: Apache-2.0
// The model of a training in this process, read from the device only when a viewer asks for it.
#pragma once
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>

#include "optim/train/train_loop.hpp"

namespace gflow {

// An observer of the training. Reading the model changes no bit of it, and takes at most 3 % of its
// time: readings are 30 times as far apart as they take, and at least two seconds.
class LiveModel : public TrainObserver {
 public:
  void after_step(TrainState& state) override;
  bool takes_warnings() const override { return false; }
  // The training is over; what it has made is in its run folder.
  void end();

  // After the first step and before end().
  bool is_training() const { return done_ > 0 && !ended_; }
  int steps_done() const { return done_; }

  struct Reading {
    int step = 0;
    HostModel model;
  };
  // Number of steps of the model that newest() would give now.
  int newest_step() const;
  // The model after the next step, or the last one read if that is too recent. Waits up to ten
  // seconds; nullptr if no step ended meanwhile.
  std::shared_ptr<const Reading> newest();

 private:
  using Clock = std::chrono::steady_clock;
  bool may_read() const { return !reading_ || Clock::now() >= next_; }

  std::atomic<int> done_{0};
  std::atomic<bool> ended_{false}, wanted_{false};
  mutable std::mutex mutex_;
  std::condition_variable read_;
  std::shared_ptr<const Reading> reading_;  // the last one
  Clock::time_point next_;                  // earliest time of the next one
};

}  // namespace gflow
