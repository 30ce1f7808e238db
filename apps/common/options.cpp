// SPDX-License-Identifier: Apache-2.0
// The only place that selects a device for work. An unusable device is rejected here, before
// anything is read or written.
#include "apps/common/options.hpp"

#include <fmt/format.h>

#include "optim/motion/gradient_check.hpp"
#include "runtime/cl/environment.hpp"
#include "runtime/cl/pocl_cache.hpp"

namespace gflow {

Queue open_queue(const GlobalOptions& options, const QueueOptions& queue_options) {
  check_environment();
  try {
    Queue queue(find_device(options.device), queue_options);
    for (const SelfCheckRow& row : full_self_check(queue))
      if (!row.passed)
        throw Error(fmt::format(
            "the OpenCL device {} fails the self-check '{}': {} exceeds {}; `gflow devices` "
            "shows all checks, --device chooses another device",
            queue.info.full_name(), row.name, row.value, row.bound));
    return queue;
  } catch (const NoRoomForPrograms&) {
    throw;
  } catch (const Error& error) {
    throw NoUsableDevice(error.what());
  }
}

}  // namespace gflow
