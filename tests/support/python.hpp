// SPDX-License-Identifier: Apache-2.0
// Runs guidance programs in Python if it is installed.
#pragma once
#include <cstdlib>
#include <string>

namespace gflow {

// A Python with NumPy, or "" if there is none. The first one in PATH may lack packages.
inline std::string python_program() {
  static const std::string program = [] {
    for (const std::string name : {"python3", "/usr/bin/python3"})
      if (std::system((name + " -c 'import numpy' 2>/dev/null").c_str()) == 0) return name;
    return std::string();
  }();
  return program;
}
inline bool has_python() { return !python_program().empty(); }
// Command prefix that lets the program import gflow_guidance.py.
inline std::string python() {
  return "PYTHONDONTWRITEBYTECODE=1 PYTHONPATH=" GFLOW_SOURCE_DIR "/apps/guidance " +
         python_program() + " ";
}

}  // namespace gflow
