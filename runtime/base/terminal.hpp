// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <unistd.h>

#include <cstdlib>
#include <string>

namespace gflow {

// Whether stderr is a terminal that can redraw a line. With TERM=dumb (Emacs and others) it cannot.
inline bool redraws_lines() {
  const char* kind = std::getenv("TERM");
  return ::isatty(STDERR_FILENO) == 1 && !(kind && std::string(kind) == "dumb");
}

// Erases a progress line that may be there; empty where lines are not redrawn.
inline const char* erase_line_sequence() { return redraws_lines() ? "\r\x1b[K" : ""; }

}  // namespace gflow
