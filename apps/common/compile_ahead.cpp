// SPDX-License-Identifier: Apache-2.0
// In PoCL's cache folder, a file gflow-HASH marks a finished kernel warm-up. A process that runs
// one holds the lock of gflow.lock.
#include "apps/common/compile_ahead.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sched.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <fstream>

#include "optim/train/warm_up.hpp"
#include "runtime/base/hash.hpp"
#include "runtime/cl/environment.hpp"
#include "runtime/cl/kernel_sources.hpp"
#include "runtime/cl/pocl_cache.hpp"
#include "runtime/files/file_lock.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

// Cores that this process may use.
int cores() {
  cpu_set_t set;
  return ::sched_getaffinity(0, sizeof set, &set) == 0 ? CPU_COUNT(&set) : 1;
}

// Depends on the kernels, the device, and the settings that select or parameterise kernels.
fs::path mark_of(const std::string& device, const TrainOptions& config) {
  uint64_t needs = hash(device);
  for (const auto& [file, text] : kernel_sources()) needs = hash(text, needs);
  for (const auto& [name, value] : setting_values(config))
    for (const char* section : {"density.", "flow.", "hexplane.", "motion.", "skip."})
      if (name.rfind(section, 0) == 0) needs = hash(name + value, needs);
  return pocl_cache_folder() / fmt::format("gflow-{:016x}", needs);
}

// Detaches the child from the parent's terminal, pipes, locks and signal handlers.
void become_second(pid_t first) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  const int nowhere = ::open("/dev/null", O_RDWR);
  if (::getppid() != first || nowhere < 0) ::_exit(0);
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) ::dup2(nowhere, stream);
  ::close_range(3, ~0u, 0);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP})
    if (std::signal(signal, SIG_DFL) == SIG_IGN) std::signal(signal, SIG_IGN);  // nohup
  ::setpriority(PRIO_PROCESS, 0, 19);
}

void compile(const std::string& device, const TrainOptions& config, const fs::path& mark) {
  try {
    const cl::Device found = find_device(device);
    if (!is_pocl(device_info(found))) return;
    const FileLock alone(mark.parent_path() / "gflow.lock", "PoCL's programs");
    if (fs::exists(mark)) return;
    Queue queue(found);
    warm_up_kernels(queue, config);
    std::ofstream(mark, std::ios::app);
  } catch (...) {  // another process compiles already, or the parent will meet the same error
  }
}

}  // namespace

CompileAhead::CompileAhead(const std::string& device, const TrainOptions& config) {
  const char* kernels = std::getenv("GFLOW_KERNEL_DIR");  // kernels under development
  if (!environment_flag("GFLOW_COMPILE_AHEAD", true) || (kernels && *kernels) || cores() < 2)
    return;
  const fs::path mark = mark_of(device, config);
  std::error_code problem;
  if (fs::exists(mark, problem)) return;
  const pid_t first = ::getpid();
  pid_ = ::fork();
  if (pid_ != 0) return;
  become_second(first);
  compile(device, config, mark);
  ::_exit(0);
}

CompileAhead::~CompileAhead() {
  if (pid_ < 0) return;
  ::kill(pid_, SIGKILL);
  while (::waitpid(pid_, nullptr, 0) < 0 && errno == EINTR) {
  }
}

}  // namespace gflow
