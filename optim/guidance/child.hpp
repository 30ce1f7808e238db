// SPDX-License-Identifier: Apache-2.0
// A child process that exchanges lines over its standard input and output and shares our standard
// error. It has its own process group: a Ctrl-C does not stop it in the middle of a step, and it is
// ended together with all processes it started.
#pragma once
#include <sys/types.h>

#include <chrono>
#include <string>

namespace gflow {

class Child {
 public:
  // Starts `command` by /bin/sh. GuidanceFailed if that is impossible.
  explicit Child(const std::string& command);
  // Closes the child's input, which asks it to end. After at most a second its process group gets
  // SIGTERM, and after another second SIGKILL.
  ~Child();
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;

  // Sends a line; `text` has no line break. GuidanceFailed if the program does not read it in time.
  // If the program has ended, that is reported by receive(), after its remaining output.
  void send(const std::string& text, std::chrono::milliseconds time_out);
  // The next line, without its line break. GuidanceFailed if the program ends, is silent for too
  // long or sends more than 1 MiB without a line break, and after an interruption
  // (runtime/base/interrupt.hpp).
  std::string receive(std::chrono::milliseconds time_out);

 private:
  [[noreturn]] void throw_process_ended();
  bool ended_within(std::chrono::milliseconds time);

  std::string command_;
  pid_t pid_ = -1;
  int status_ = 0;
  bool ended_ = false;
  int in_ = -1, out_ = -1;  // our ends of its standard input (a socket) and output (a pipe)
  std::string received_;    // bytes received but not yet returned
};

}  // namespace gflow
