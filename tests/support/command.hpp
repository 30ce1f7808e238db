// SPDX-License-Identifier: Apache-2.0
// Runs the gflow program as a user does.
#pragma once
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <functional>
#include <thread>

#include "tests/support/temporary_folder.hpp"

namespace gflow {

namespace fs = std::filesystem;

struct Outcome {
  int code = -1;  // 128 + signal if a signal ended it
  std::string out, err;
};

// One run of the program with these arguments. `first` is a shell command that runs before the
// program, such as setting a limit; without it no shell is used.
class Command {
 public:
  explicit Command(std::vector<std::string> arguments, const std::string& first = "") {
    arguments.insert(arguments.begin(), GFLOW_BINARY);
    if (!first.empty())
      arguments.insert(arguments.begin(), {"/bin/sh", "-c", first + "; exec \"$0\" \"$@\""});
    std::vector<char*> argv;
    for (std::string& argument : arguments) argv.push_back(argument.data());
    argv.push_back(nullptr);
    const std::string out = folder_.file("out"), err = folder_.file("err");
    pid_ = fork();
    if (pid_ != 0) return;
    setpgid(0, 0);                 // a signal can be sent to all its children
    std::signal(SIGINT, SIG_DFL);  // shells ignore it in background processes
    dup2(open(out.c_str(), O_WRONLY | O_CREAT, 0600), STDOUT_FILENO);
    dup2(open(err.c_str(), O_WRONLY | O_CREAT, 0600), STDERR_FILENO);
    execv(argv[0], argv.data());
    _exit(127);
  }
  void send(int signal) const { kill(pid_, signal); }
  // Sends to the program and all processes of its group, as a terminal does.
  void send_to_group(int signal) const { kill(-pid_, signal); }
  // Waits until exec has happened and the program handles the signal.
  void wait_for_handler(int signal) const {
    for (int i = 0; i < 2000; ++i) {
      std::error_code gone;
      const std::string process = "/proc/" + std::to_string(pid_);
      const bool started = fs::read_symlink(process + "/exe", gone) == fs::canonical(GFLOW_BINARY);
      std::ifstream status(process + "/status");
      for (std::string line; started && std::getline(status, line);)
        if (line.rfind("SigCgt:", 0) == 0 &&
            std::stoull(line.substr(7), nullptr, 16) >> (signal - 1) & 1)
          return;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
  // The output on stderr so far.
  std::string said() const { return contents(folder_.file("err")); }
  // The same on stdout.
  std::string printed() const { return contents(folder_.file("out")); }
  Outcome wait() const {
    int status = 0;
    waitpid(pid_, &status, 0);
    Outcome outcome;
    outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    outcome.out = contents(folder_.file("out"));
    outcome.err = contents(folder_.file("err"));
    return outcome;
  }

 private:
  TemporaryFolder folder_;
  pid_t pid_ = -1;
};

inline Outcome gflow(const std::vector<std::string>& arguments, const std::string& first = "") {
  return Command(arguments, first).wait();
}

// Expects one sentence on stderr, "gflow: ...", with all the parts; exit code 1; nothing on stdout.
inline void expect_refused(const std::vector<std::string>& arguments,
                           std::initializer_list<std::string> parts,
                           const std::string& first = "") {
  const Outcome outcome = gflow(arguments, first);
  EXPECT_EQ(outcome.code, 1) << outcome.err;
  EXPECT_EQ(outcome.out, "");
  EXPECT_EQ(outcome.err.rfind("gflow: ", 0), 0u) << outcome.err;
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  EXPECT_EQ(outcome.err.find("internal error"), std::string::npos) << outcome.err;
  for (const std::string& part : parts)
    EXPECT_NE(outcome.err.find(part), std::string::npos) << part << " in " << outcome.err;
}

// Waits until the condition holds, at most a minute.
inline bool wait_until(const std::function<bool()>& come_to_pass) {
  for (int i = 0; i < 60000 && !come_to_pass(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  return come_to_pass();
}

}  // namespace gflow
