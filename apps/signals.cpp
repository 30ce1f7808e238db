// SPDX-License-Identifier: Apache-2.0
#include "apps/signals.hpp"

#include <unistd.h>

#include <csignal>

#include "optim/train/interrupt.hpp"

namespace gflow {
namespace {

// Calls nothing but what POSIX allows in a handler.
void stop_at_once(int signal) {
  constexpr char sentence[] = "gflow: interrupted\n";
  if (::write(STDERR_FILENO, sentence, sizeof sentence - 1) < 0) _exit(exit_code_of(signal));
  _exit(exit_code_of(signal));
}

}  // namespace

void set_signals() {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP})
    if (std::signal(signal, stop_at_once) == SIG_IGN) std::signal(signal, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

}  // namespace gflow
