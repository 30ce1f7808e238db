// SPDX-License-Identifier: Apache-2.0
// For what went wrong and does not stop the work; what does is an Error.
#pragma once
#include <cstdio>
#include <string>

#include "runtime/base/printable.hpp"

namespace gflow {

// One sentence on stderr.
inline void warn(const std::string& sentence) {
  std::fprintf(stderr, "gflow: warning: %s\n", printable(sentence).c_str());
}

}  // namespace gflow
