// SPDX-License-Identifier: Apache-2.0
// Handling of Ctrl-C and similar signals. Under an InterruptGuard, for work with something to save,
// the first signal only sets a flag, so that the current step finishes and results are written; the
// second one ends the program at once. Without a guard the first one does.
#pragma once
#include <csignal>
#include <list>
#include <map>
#include <string>

#include "runtime/base/error.hpp"

namespace gflow {

// Work that stopped because the user asked for it, after everything worth keeping was written.
struct Interrupted : Error {
  using Error::Error;
};

// While it exists, SIGINT, SIGTERM and SIGHUP set interrupted(). Signals that were ignored before
// (nohup) stay ignored. The destructor restores the previous handlers. Only one may exist.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

 private:
  std::map<int, struct sigaction> former_;
};

// Whether a signal came since the guard was built. Cheap: call it once per step.
bool interrupted();

// From now on interrupted() is also true once process `parent` is no longer the parent of this one,
// as after SIGTERM.
void stop_without_parent(int parent);

// Ends the program with one sentence on stderr, removes unfinished files, exit code 128 + signal. A
// signal handler: calls only what POSIX allows in one.
[[noreturn]] void stop_at_once(int signal);

// The sentence that stop_at_once() prints while this exists: what was being done, and what follows
// from the stop. Only one may exist at a time.
class StopSentence {
 public:
  explicit StopSentence(const std::string& sentence) { set(sentence); }
  ~StopSentence();
  StopSentence(const StopSentence&) = delete;
  StopSentence& operator=(const StopSentence&) = delete;
  // Replaces the sentence.
  void set(const std::string& sentence);

 private:
  std::list<std::string> lines_;  // all of them, since a handler may be reading one
};

// Exit code of a program that this signal interrupted, as in shells: 130 for Ctrl-C (SIGINT), 143
// for SIGTERM, 129 for SIGHUP.
constexpr int exit_code_of(int signal) { return 128 + signal; }
// Exit code of the last signal; 130 if none came.
int interrupted_exit_code();

}  // namespace gflow
