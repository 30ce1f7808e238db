// SPDX-License-Identifier: Apache-2.0
#include "apps/common/checked_device.hpp"

#include <fmt/format.h>

#include "optim/motion/gradient_check.hpp"

namespace gflow {

std::string type_of(const DeviceInfo& info) {
  return info.is_cpu ? "CPU" : info.is_gpu ? "GPU" : "other";
}

CheckedDevice checked(const DeviceInfo& info) {
  CheckedDevice device{info, {}, ""};
  try {
    Queue queue(find_device(std::to_string(info.index)));
    device.rows = full_self_check(queue);
    for (const SelfCheckRow& row : device.rows)
      if (!row.passed && device.reason.empty())
        device.reason = fmt::format("{}: {:.3g} exceeds {:.3g}", row.name, row.value, row.bound);
  } catch (const Error& error) {
    device.reason = error.what();
  }
  return device;
}

nlohmann::ordered_json as_json(const CheckedDevice& device) {
  const DeviceInfo& info = device.info;
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  for (const SelfCheckRow& row : device.rows)
    rows.push_back(
        {{"name", row.name}, {"figure", row.value}, {"bound", row.bound}, {"passed", row.passed}});
  return {{"index", info.index},
          {"name", info.name},
          {"platform", info.platform},
          {"type", type_of(info)},
          {"compute_units", info.compute_units},
          {"memory_bytes", info.global_memory},
          {"max_allocation_bytes", info.max_allocation},
          {"local_memory_bytes", info.local_memory},
          {"fp64", info.fp64},
          {"lanes", info.lanes},
          {"max_work_group", info.max_work_group},
          {"driver", info.driver},
          {"opencl", info.version},
          {"self_check", rows},
          {"usable", device.reason.empty()},
          {"reason", device.reason}};
}

}  // namespace gflow
