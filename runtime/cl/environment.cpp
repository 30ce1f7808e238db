// SPDX-License-Identifier: Apache-2.0
#include "runtime/cl/environment.hpp"

#include <fmt/format.h>

#include <cstdlib>
#include <filesystem>

#include "runtime/base/error.hpp"
#include "runtime/cl/watchdog.hpp"

namespace gflow {

bool environment_flag(const char* variable, bool otherwise) {
  const char* value = std::getenv(variable);
  const std::string answer = value ? value : "";
  if (answer.empty()) return otherwise;
  if (answer != "0" && answer != "1")
    throw Error(fmt::format("{} is '{}'; it must be 1 or 0", variable, answer));
  return answer == "1";
}

void check_environment() {
  device_timeout();
  for (const char* variable : {"GFLOW_COMPILE_AHEAD", "GFLOW_POISON_BUFFERS", "GFLOW_SYNC"})
    environment_flag(variable, false);
  const char* kernels = std::getenv("GFLOW_KERNEL_DIR");
  std::error_code problem;
  if (kernels && *kernels && !std::filesystem::is_directory(kernels, problem))
    throw Error(fmt::format("GFLOW_KERNEL_DIR is '{}'; it must be a folder of kernels", kernels));
}

}  // namespace gflow
