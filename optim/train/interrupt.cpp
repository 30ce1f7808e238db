// SPDX-License-Identifier: Apache-2.0
// A signal handler may touch nothing but a lock-free flag and call little but write, hence the one
// variable of this file.
#include "optim/train/interrupt.hpp"

#include <unistd.h>

#include <atomic>

namespace gflow {
namespace {

std::atomic<int> signal_that_came{0};
static_assert(std::atomic<int>::is_always_lock_free, "a signal handler may not wait for a lock");

void on_signal(int signal) {
  if (!signal_that_came.exchange(signal)) return;
  constexpr char sentence[] = "gflow: interrupted twice and stopped at once\n";
  if (::write(STDERR_FILENO, sentence, sizeof sentence - 1) < 0) _exit(exit_code_of(signal));
  _exit(exit_code_of(signal));
}

}  // namespace

InterruptGuard::InterruptGuard() {
  signal_that_came = 0;
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction former = {};
    sigaction(signal, nullptr, &former);
    if (former.sa_handler == SIG_IGN) continue;
    struct sigaction action = {};
    action.sa_handler = on_signal;
    action.sa_flags = SA_RESTART;  // reads and writes under way go on
    sigemptyset(&action.sa_mask);
    sigaction(signal, &action, nullptr);
    former_[signal] = former;
  }
}

InterruptGuard::~InterruptGuard() {
  for (const auto& [signal, former] : former_) sigaction(signal, &former, nullptr);
}

bool interrupted() { return signal_that_came != 0; }

int interrupted_exit_code() {
  const int signal = signal_that_came;
  return exit_code_of(signal ? signal : SIGINT);
}

}  // namespace gflow
