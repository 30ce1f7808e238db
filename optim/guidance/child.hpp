// SPDX-License-Identifier: Apache-2.0
// A program that is talked to in lines, over its standard input and output; its standard error is
// ours. It is a process group of its own, so that a Ctrl-C meant for us does not end it in the
// middle of a step, and it is ended and reaped with everything it started.
#pragma once
#include <sys/types.h>

#include <chrono>
#include <string>

namespace gflow {

class Child {
 public:
  // Starts `command` by /bin/sh. GuidanceFailed when that is impossible.
  explicit Child(const std::string& command);
  // Closes its input, which asks it to end; when it has, or after a second, it is terminated with
  // all that it has started, after another second what is left is killed.
  ~Child();
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  // Sends a line; `text` has no line break. GuidanceFailed when the program does not read it in
  // time. That it has ended is told by receive(), after what it said before.
  void send(const std::string& text, std::chrono::milliseconds time_out);
  // The next line, without its end. GuidanceFailed when the program ends instead, is silent for too
  // long or sends more than a mebibyte without a line break, and after an interruption
  // (io/interrupt.hpp).
  std::string receive(std::chrono::milliseconds time_out);

 private:
  [[noreturn]] void fail_as_ended();
  bool ended_within(std::chrono::milliseconds time);

  std::string command_;
  pid_t pid_ = -1;
  int status_ = 0;
  bool ended_ = false;
  int in_ = -1, out_ = -1;  // our ends of its standard input (a socket) and output (a pipe)
  std::string received_;    // and not yet returned
};

}  // namespace gflow
