// SPDX-License-Identifier: Apache-2.0
// Guidance programs in Python, where it is installed.
#pragma once
#include <cstdlib>
#include <string>

namespace gflow {

inline bool has_python() {
  static const bool there = std::system("python3 -c 'import numpy' 2>/dev/null") == 0;
  return there;
}
// What a command begins with so that the program finds gflow_guidance.py.
inline std::string python() {
  return "PYTHONDONTWRITEBYTECODE=1 PYTHONPATH=" GFLOW_SOURCE_DIR "/apps/guidance python3 ";
}

}  // namespace gflow
