// SPDX-License-Identifier: Apache-2.0
// A progress line on stderr. On a terminal it is redrawn in place, at most ten times a second. In a
// file or pipe it is a plain line every few seconds, later less often, so that logs stay readable.
#pragma once
#include <chrono>
#include <mutex>
#include <string>
#include <vector>

#include "runtime/base/report.hpp"

namespace gflow {

// A value beside the bar: {"loss", "0.0213"}. Without a name only the value is shown.
struct ProgressTerm {
  std::string name, value;
};

// "4:07" or "1:02:09"; "-:--" if unknown (NaN, infinite or negative). [seconds]
std::string duration_text(double seconds);

struct ProgressState {
  std::string label;
  long first = 0;  // count at which the clock started; the speed is that of the steps since
  long done = 0, total = 0;
  std::vector<ProgressTerm> terms;
};

// The line itself after `seconds` of work, at most `width` characters. Where space is short, terms
// are dropped from the right, then the bar:
//   train  [#####-----]  4200/10000  52.3 it/s  ETA 1:51  loss 0.0213  psnr 31.2
std::string progress_line(const ProgressState& state, double seconds, size_t width);

// Shows progress until finish() or destruction. update() may be called from several threads.
class Progress {
 public:
  // `first` is where the count starts (a resumed run); it does not count for the speed.
  Progress(std::string label, long total, bool quiet = false, long first = 0);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // Sets the count. Draws if the last drawing is old enough.
  void update(long done, std::vector<ProgressTerm> terms = {});
  // Adds one to the count.
  void advance();
  // Prints a sentence on a line of its own, even if quiet.
  void print_line(const std::string& sentence);
  // Draws the last state and ends the line.
  void finish();

 private:
  using Clock = std::chrono::steady_clock;
  void draw_if_due();
  void draw(bool last);

  ProgressState state_;
  bool quiet_, terminal_, finished_ = false;
  Clock::time_point start_, drawn_;
  std::mutex mutex_;
};

// A callback that updates a progress line, which must outlive it.
inline ProgressCallback progress_callback(Progress& progress) {
  return [&progress](size_t done, size_t) { progress.update(long(done)); };
}

}  // namespace gflow
