// SPDX-License-Identifier: Apache-2.0
// Warnings: problems that do not stop the work. Problems that do are Errors.
#pragma once
#include <cstdio>
#include <functional>
#include <mutex>
#include <set>
#include <string>
#include <utility>

#include "runtime/base/printable.hpp"

namespace gflow {

// Sends the warnings of this process elsewhere while it lives. `sink` is called by any thread, one
// call at a time.
class WarningsTo {
 public:
  using Sink = std::function<void(const std::string& sentence)>;
  explicit WarningsTo(Sink sink) { exchange(sink, before_); }
  ~WarningsTo() { exchange(before_, before_); }
  WarningsTo(const WarningsTo&) = delete;
  WarningsTo& operator=(const WarningsTo&) = delete;

  // Calls the present sink; false if there is none.
  static bool send(const std::string& sentence) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (sink_) sink_(sentence);
    return bool(sink_);
  }

 private:
  static void exchange(Sink next, Sink& before) {
    const std::lock_guard<std::mutex> lock(mutex_);
    before = std::exchange(sink_, std::move(next));
  }
  inline static std::mutex mutex_;
  inline static Sink sink_;
  Sink before_;
};

// Prints a warning on stderr.
inline void print_warning(const std::string& sentence) {
  std::fprintf(stderr, "gflow: warning: %s\n", printable(sentence).c_str());
}

// Prints one sentence on stderr, unless WarningsTo takes it.
inline void warn(const std::string& sentence) {
  if (!WarningsTo::send(sentence)) print_warning(sentence);
}

// The same, unless this process has printed that sentence before: a file may be read twice.
inline void warn_once(const std::string& sentence) {
  static std::mutex mutex;
  static std::set<std::string> printed;
  const std::lock_guard<std::mutex> lock(mutex);
  if (printed.insert(sentence).second) warn(sentence);
}

}  // namespace gflow
