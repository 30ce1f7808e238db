// SPDX-License-Identifier: Apache-2.0
#include "optim/networks/trial.hpp"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>

namespace gflow {
namespace {

// The signal handlers of this process (which, for one, remove its unfinished files) must not run in
// the forked process.
void forget_signal_handlers() {
  for (int signal = 1; signal < NSIG; ++signal)
    if (::signal(signal, SIG_DFL) == SIG_IGN) ::signal(signal, SIG_IGN);  // nohup
}

// Blocks all signals while it exists.
class Deaf {
 public:
  Deaf() {
    sigset_t all;
    sigfillset(&all);
    ::pthread_sigmask(SIG_SETMASK, &all, &before_);
  }
  Deaf(const Deaf&) = delete;
  Deaf& operator=(const Deaf&) = delete;
  ~Deaf() { ::pthread_sigmask(SIG_SETMASK, &before_, nullptr); }

 private:
  sigset_t before_;
};

// fork() with default signal handlers in the child from its first instruction on.
pid_t fork_without_handlers() {
  const Deaf deaf;
  const pid_t copy = ::fork();
  if (copy == 0) forget_signal_handlers();
  return copy;
}

[[noreturn]] void run_in_child(const std::function<void()>& work, pid_t first) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != first) ::_exit(0);
  const rlimit none{0, 0};
  ::setrlimit(RLIMIT_CORE, &none);
  const int nowhere = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
  ::dup2(nowhere, STDOUT_FILENO);
  ::dup2(nowhere, STDERR_FILENO);
  try {
    work();
  } catch (...) {  // thrown again, and reported, when the work is done for real
  }
  ::_exit(0);
}

}  // namespace

std::string crash_signal_of(const std::function<void()>& work) {
  const pid_t first = ::getpid(), copy = fork_without_handlers();
  if (copy < 0) return "";  // cannot fork: skip the trial
  if (copy == 0) run_in_child(work, first);
  int status = 0;
  while (::waitpid(copy, &status, 0) < 0)
    if (errno != EINTR) return "";
  if (WIFEXITED(status))  // sanitizers exit with a code instead of a signal
    return WEXITSTATUS(status) == 0 ? "" : "an error reported by its sanitizer";
  const int signal = WTERMSIG(status);
  const bool interrupted = signal == SIGINT || signal == SIGTERM || signal == SIGHUP;
  return interrupted ? "" : ::strsignal(signal);
}

}  // namespace gflow
