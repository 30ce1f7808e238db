// SPDX-License-Identifier: Apache-2.0
// One line on stderr that tells how far a long task is. On a terminal it is redrawn in place, at
// most ten times a second; into a file or pipe it becomes a plain line every few seconds, so that
// logs stay readable.
#pragma once
#include <chrono>
#include <mutex>
#include <string>
#include <vector>

#include "runtime/base/report.hpp"

namespace gflow {

// A figure beside the bar: {"loss", "0.0213"}. Without a name only the value is shown.
struct ProgressTerm {
  std::string name, value;
};

// "4:07" or "1:02:09"; "-:--" for what is not known (NaN, infinite or negative). [seconds]
std::string duration_text(double seconds);

struct ProgressState {
  std::string label;
  long first = 0;  // the count at which the clock started; the speed is that of the steps since
  long done = 0, total = 0;
  std::vector<ProgressTerm> terms;
};

// The line itself, at most `width` characters: terms are dropped from the right, then the bar,
// where space is short. After `seconds` of work:
//   train  [#####-----]  4200/10000  52.3 it/s  ETA 1:51  loss 0.0213  psnr 31.2
std::string progress_line(const ProgressState& state, double seconds, size_t width);

// Shows progress until finish() or the end of its life. update() may be called from several
// threads.
class Progress {
 public:
  // `first` is where the count starts (a resumed run): it does not count for the speed.
  Progress(std::string label, long total, bool quiet = false, long first = 0);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  // Sets the count; draws if the last drawing is old enough.
  void update(long done, std::vector<ProgressTerm> terms = {});
  // Adds one to the count.
  void advance();
  // Writes a sentence on a line of its own, quiet or not.
  void say(const std::string& sentence);
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

// Passes counts on to a progress line, which must outlive it.
inline ProgressCallback counted(Progress& progress) {
  return [&progress](size_t done, size_t) { progress.update(long(done)); };
}

}  // namespace gflow
