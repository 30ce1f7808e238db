// SPDX-License-Identifier: Apache-2.0
// Ctrl-C and its relatives. Where there is something to save, under an InterruptGuard, the first
// signal only raises a flag, so that the step in progress is finished and what is there is written;
// the second one ends the program at once. Everywhere else the first one does.
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

// While one of these lives, SIGINT, SIGTERM and SIGHUP set interrupted(). A signal that was ignored
// before (nohup) stays ignored. The former handlers come back at the end. One at a time.
class InterruptGuard {
 public:
  InterruptGuard();
  ~InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;

 private:
  std::map<int, struct sigaction> former_;
};

// Whether a signal came since the guard was built. Cheap: ask once a step.
bool interrupted();

// From now on interrupted() also where the process that started this one, of that number, is gone:
// as by SIGTERM.
void stop_without_parent(int parent);

// Ends the program: one sentence on stderr, no file left half-written, exit code 128 + signal.
// Calls nothing but what POSIX allows in a signal handler, and is meant to be one.
[[noreturn]] void stop_at_once(int signal);

// What stop_at_once() says while this lives: what was being done, and what comes of it. One at a
// time.
class StopSentence {
 public:
  explicit StopSentence(const std::string& sentence) { say(sentence); }
  ~StopSentence();
  StopSentence(const StopSentence&) = delete;
  StopSentence& operator=(const StopSentence&) = delete;
  // From now on another one.
  void say(const std::string& sentence);

 private:
  std::list<std::string> lines_;  // all of them: a handler may be reading one
};

// Exit code of a program that this signal interrupted, as shells have it: 130 for Ctrl-C (SIGINT),
// 143 for SIGTERM, 129 for SIGHUP.
constexpr int exit_code_of(int signal) { return 128 + signal; }
// That of the last signal; 130 if none came.
int interrupted_exit_code();

}  // namespace gflow
