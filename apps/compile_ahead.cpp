// SPDX-License-Identifier: Apache-2.0
#include "apps/compile_ahead.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <thread>

#include "optim/train/rehearsal.hpp"
#include "runtime/environment.hpp"
#include "runtime/hash.hpp"
#include "runtime/pocl_cache.hpp"
#include "runtime/program.hpp"

namespace gflow {
namespace {

// By the kernels and by what decides most about which are used: where other settings need others,
// they are few.
std::filesystem::path mark_of(const TrainConfig& config) {
  const std::string needs = fmt::format("{} {} {}", name_of(config.motion.model),
                                        config.flow.enabled, name_of(config.flow.transport));
  const uint64_t kernels = hash(expand_includes("raster.cl"), hash(expand_includes("common.cl")));
  return pocl_cache_folder() / fmt::format("gflow-{:016x}", hash(needs, kernels));
}

// Whether nobody else did; at the end of the process it is there.
bool make(const std::filesystem::path& mark) {
  const int file = ::open(mark.c_str(), O_CREAT | O_EXCL | O_WRONLY | O_CLOEXEC, 0644);
  if (file < 0) return false;
  ::close(file);
  return true;
}

// Leaves no trace in terminals, pipes and handlers of the first.
void become_second(pid_t first) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != first) ::_exit(0);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) std::signal(signal, SIG_DFL);
  const int nowhere = ::open("/dev/null", O_RDWR);
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) ::dup2(nowhere, stream);
}

void forget(const std::filesystem::path& mark) {
  std::error_code problem;
  std::filesystem::remove(mark, problem);
}

void compile(const std::string& device, const TrainConfig& config,
             const std::filesystem::path& mark) {
  bool marked = false;
  try {
    const cl::Device found = find_device(device);
    marked = is_pocl(device_info(found)) && make(mark);
    if (!marked) return;
    Queue queue(found);
    rehearse(queue, config);
  } catch (...) {  // whatever it is, the first process will come to it
    if (marked) forget(mark);
  }
}

}  // namespace

CompileAhead::CompileAhead(const std::string& device, const TrainConfig& config) {
  if (!is_wanted("GFLOW_COMPILE_AHEAD", true) || std::thread::hardware_concurrency() < 2) return;
  mark_ = mark_of(config);
  std::error_code problem;
  if (std::filesystem::exists(mark_, problem)) return;
  const pid_t first = ::getpid();
  pid_ = ::fork();
  if (pid_ != 0) return;
  become_second(first);
  compile(device, config, mark_);
  ::_exit(0);
}

CompileAhead::~CompileAhead() {
  if (pid_ < 0) return;
  ::kill(pid_, SIGKILL);
  int status = 0;
  while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFSIGNALED(status)) forget(mark_);  // the next training goes on
}

}  // namespace gflow
