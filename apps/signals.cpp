// SPDX-License-Identifier: Apache-2.0
#include "apps/signals.hpp"

#include <csignal>
#include <cstdlib>

#include "optim/io/interrupt.hpp"
#include "optim/io/unfinished_file.hpp"

namespace gflow {

void set_signals() {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP})
    if (std::signal(signal, stop_at_once) == SIG_IGN) std::signal(signal, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  std::at_quick_exit([] { remove_unfinished_files(); });  // a device that hangs (Watchdog)
}

}  // namespace gflow
