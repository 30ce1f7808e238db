// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
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

// Characters per line on stdout, 60 to 100: COLUMNS if it is set, else the width of the terminal,
// else 80.
inline size_t line_width() {
  const char* columns = std::getenv("COLUMNS");
  long width = columns ? std::strtol(columns, nullptr, 10) : 0;
  winsize size{};
  if (width <= 0 && ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0) width = size.ws_col;
  if (width <= 0) width = 80;
  return size_t(std::clamp(width, 60L, 100L));
}

}  // namespace gflow
