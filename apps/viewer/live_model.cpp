// SPDX-License-Identifier: Apache-2.0
#include "apps/viewer/live_model.hpp"

#include <algorithm>

namespace gflow {

void LiveModel::after_step(TrainState& state) {
  done_ = state.done;
  if (!wanted_) return;
  state.queue.finish();  // so that only the reading is measured
  const Clock::time_point begin = Clock::now();
  auto reading = std::make_shared<Reading>(Reading{state.done, state.model().read(state.queue)});
  const Clock::time_point end = Clock::now();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    reading_ = std::move(reading);
    next_ = end + std::max<Clock::duration>(30 * (end - begin), std::chrono::seconds(2));
    wanted_ = false;
  }
  read_.notify_all();
}

void LiveModel::end() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ended_ = true;
  }
  read_.notify_all();
}

int LiveModel::newest_step() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return may_read() ? int(done_) : reading_->step;
}

std::shared_ptr<const LiveModel::Reading> LiveModel::newest() {
  std::unique_lock<std::mutex> lock(mutex_);
  if (!may_read() || ended_) return reading_;
  const std::shared_ptr<const Reading> before = reading_;
  wanted_ = true;
  read_.wait_for(lock, std::chrono::seconds(10), [&] { return ended_ || reading_ != before; });
  return reading_;
}

}  // namespace gflow
