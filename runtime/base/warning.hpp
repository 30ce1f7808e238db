// SPDX-License-Identifier: Apache-2.0
// Warnings: problems that do not stop the work. Problems that do are Errors.
#pragma once
#include <cstdio>
#include <string>

#include "runtime/base/printable.hpp"

namespace gflow {

// Prints one sentence on stderr.
inline void warn(const std::string& sentence) {
  std::fprintf(stderr, "gflow: warning: %s\n", printable(sentence).c_str());
}

}  // namespace gflow
