// SPDX-License-Identifier: Apache-2.0
// Warnings: problems that do not stop the work. Problems that do are Errors.
#pragma once
#include <cstdio>
#include <mutex>
#include <set>
#include <string>

#include "runtime/base/printable.hpp"

namespace gflow {

// Prints one sentence on stderr.
inline void warn(const std::string& sentence) {
  std::fprintf(stderr, "gflow: warning: %s\n", printable(sentence).c_str());
}

// The same, unless this process has printed that sentence before: a file may be read twice.
inline void warn_once(const std::string& sentence) {
  static std::mutex mutex;
  static std::set<std::string> printed;
  const std::lock_guard<std::mutex> lock(mutex);
  if (printed.insert(sentence).second) warn(sentence);
}

}  // namespace gflow
