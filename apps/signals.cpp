// SPDX-License-Identifier: Apache-2.0
#include "apps/signals.hpp"

#include <csignal>

#include "optim/io/interrupt.hpp"

namespace gflow {

void set_signals() {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP})
    if (std::signal(signal, stop_at_once) == SIG_IGN) std::signal(signal, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

}  // namespace gflow
