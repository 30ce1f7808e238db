// SPDX-License-Identifier: Apache-2.0
#include "optim/train/train_loop.hpp"

namespace gflow {

const StepReport& TrainState::report() {
  if (!report_) report_ = trainer.report(queue);
  return *report_;
}

std::unique_ptr<WarningsTo> warnings_to(TrainObserver* observer) {
  if (!observer || !observer->takes_warnings()) return nullptr;
  return std::make_unique<WarningsTo>(
      [observer](const std::string& sentence) { observer->on_notice(sentence); });
}

int train_loop(Queue& queue, Trainer& trainer, int first, int steps, TrainObserver& observer) {
  int done = first;
  while (done < steps && !observer.stop(done)) {
    trainer.step(queue, done);
    TrainState state(queue, trainer, done + 1, steps);
    const std::string notice = trainer.take_notice();
    if (!notice.empty()) observer.on_notice(notice);
    observer.after_step(state);
    done = state.done;
  }
  queue.finish();
  return done;
}

}  // namespace gflow
