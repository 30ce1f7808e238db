// SPDX-License-Identifier: Apache-2.0
// Signal handlers may only use lock-free variables and call async-signal-safe functions like write.
#include "runtime/base/interrupt.hpp"

#include <unistd.h>

#include <atomic>
#include <cstring>

#include "runtime/base/terminal.hpp"
#include "runtime/base/unfinished_file.hpp"

namespace gflow {
namespace {

std::atomic<int> signal_that_came{0}, parent_to_stop_without{0};
constexpr char kNoSentence[] = "gflow: interrupted\n";
std::atomic<const char*> line_at_stop{kNoSentence};
static_assert(std::atomic<int>::is_always_lock_free, "a signal handler may not wait for a lock");

[[noreturn]] void end_with(const char* line, int signal) {
  remove_unfinished_files();
  if (::write(STDERR_FILENO, line, std::strlen(line)) < 0) _exit(exit_code_of(signal));
  _exit(exit_code_of(signal));
}

void on_signal(int signal) {
  if (signal_that_came.exchange(signal))
    end_with("gflow: interrupted twice and stopped at once\n", signal);
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
    action.sa_flags = SA_RESTART;  // interrupted reads and writes continue
    sigemptyset(&action.sa_mask);
    sigaction(signal, &action, nullptr);
    former_[signal] = former;
  }
}

InterruptGuard::~InterruptGuard() {
  for (const auto& [signal, former] : former_) sigaction(signal, &former, nullptr);
}

void stop_at_once(int signal) { end_with(line_at_stop, signal); }

void StopSentence::set(const std::string& sentence) {
  // On a terminal, first erases a progress line that may be there.
  lines_.push_back(erase_line_sequence() + ("gflow: " + sentence) + "\n");
  line_at_stop = lines_.back().c_str();
}

StopSentence::~StopSentence() { line_at_stop = kNoSentence; }

void stop_without_parent(int parent) { parent_to_stop_without = parent; }

bool interrupted() {
  const int parent = parent_to_stop_without;
  if (parent != 0 && ::getppid() != parent) {
    int none = 0;
    signal_that_came.compare_exchange_strong(none, SIGTERM);
  }
  return signal_that_came != 0;
}

int interrupted_exit_code() {
  const int signal = signal_that_came;
  return exit_code_of(signal ? signal : SIGINT);
}

}  // namespace gflow
