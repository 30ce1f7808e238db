// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <unistd.h>

#include <cstdlib>
#include <string>

namespace gflow {

// Whether stderr is a terminal on which a line can be written anew. Emacs and its like say of
// themselves (TERM=dumb) that they cannot.
inline bool redraws_lines() {
  const char* kind = std::getenv("TERM");
  return ::isatty(STDERR_FILENO) == 1 && !(kind && std::string(kind) == "dumb");
}

// What removes a progress line that may stand there; nothing where there can be none.
inline const char* line_eraser() { return redraws_lines() ? "\r\x1b[K" : ""; }

}  // namespace gflow
