// SPDX-License-Identifier: Apache-2.0
// Records what a training says to its user, for reports, also later ones.
#pragma once
#include <algorithm>
#include <string>
#include <vector>

#include "optim/runs/run_folder.hpp"
#include "optim/train/train_loop.hpp"

namespace gflow::report {

// Passes everything on to another observer, if there is one. While it lives, warnings are recorded
// and printed, or passed on; events of the training are recorded.
class RecordedNotices : public TrainObserver {
 public:
  explicit RecordedNotices(TrainObserver* beside, bool passes_warnings_on = false)
      : beside_(beside), warnings_([this, passes_warnings_on](const std::string& sentence) {
          add(sentence);
          if (passes_warnings_on)
            beside_->on_notice(sentence);
          else
            print_warning(sentence);
        }) {}

  // Records without printing.
  void add(const std::string& sentence) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (std::find(sentences_.begin(), sentences_.end(), sentence) == sentences_.end())
      sentences_.push_back(sentence);
  }

  // In their order, each once.
  const std::vector<std::string>& sentences() const { return sentences_; }

  void on_flow(size_t done, size_t pairs) override {
    if (beside_) beside_->on_flow(done, pairs);
  }
  void after_step(TrainState& state) override {
    if (beside_) beside_->after_step(state);
  }
  void on_notice(const std::string& sentence) override {
    add(sentence);
    if (beside_) beside_->on_notice(sentence);
  }
  bool takes_warnings() const override { return false; }
  bool stop(int done) override { return beside_ && beside_->stop(done); }

 private:
  TrainObserver* beside_;
  std::mutex mutex_;
  std::vector<std::string> sentences_;
  WarningsTo warnings_;
};

// The sentences of a run's trainings, in its notices.json; none if it cannot be read.
std::vector<std::string> read_notices(const RunFolder& run);
// Writes them. Warns if it cannot.
void write_notices(const RunFolder& run, const std::vector<std::string>& sentences);

}  // namespace gflow::report
