// SPDX-License-Identifier: Apache-2.0
#include "apps/common/signals.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <string>

#include "runtime/base/interrupt.hpp"

namespace gflow {
namespace {

constexpr const char* kParentVariable = "GFLOW_PARENT";  // process id of the parent

}  // namespace

void open_standard_streams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (::fcntl(stream, F_GETFD) >= 0) continue;
    // open() returns the lowest free descriptor, which is this stream. Writes to standard output
    // must fail.
    const int mode = stream == STDERR_FILENO ? O_WRONLY : O_RDONLY;
    if (::open("/dev/null", mode) < 0) return;
  }
}

void set_signals() {
  for (const int signal : {SIGINT, SIGTERM, SIGHUP})
    if (std::signal(signal, stop_at_once) == SIG_IGN) std::signal(signal, SIG_IGN);
  for (const int signal : {SIGXFSZ, SIGPIPE}) std::signal(signal, SIG_IGN);
  const char* parent = std::getenv(kParentVariable);
  if (parent && parent == std::to_string(::getppid())) stop_without_parent(::getppid());
}

void let_children_end_with_this() {
  ::setenv(kParentVariable, std::to_string(::getpid()).c_str(), 1);
}

}  // namespace gflow
