// SPDX-License-Identifier: Apache-2.0
// Another program, run to its end with its output in a file. Arguments reach it as they are:
// no shell reads them.
#pragma once
#include <sys/types.h>

#include <string>
#include <vector>

namespace gflow {

// Path of an executable file of that name in the folders of PATH; empty if there is none.
std::string find_on_path(const std::string& name);

// How a process ended, of the status that waitpid() gives: "exited with code 3", "was killed by
// signal 9 (Killed)".
std::string ending_of(int status);

class RunningProgram {
 public:
  // Starts arguments[0], a path. It reads nothing; all it prints is appended to the file `log`.
  // It has its own process group, so that Ctrl-C reaches this program only. Error if it cannot be
  // started.
  RunningProgram(std::vector<std::string> arguments, const std::string& log);
  // Kills it and the processes it started, unless it has ended.
  ~RunningProgram();
  RunningProgram(const RunningProgram&) = delete;
  RunningProgram& operator=(const RunningProgram&) = delete;

  bool has_ended();
  // Once it has ended: 0 for success, else for ending_of().
  int status() const { return status_; }

 private:
  pid_t pid_ = -1;
  int status_ = 0;
  bool ended_ = false;
};

}  // namespace gflow
