// SPDX-License-Identifier: Apache-2.0
// `gflow devices`: lists the devices, their relevant properties and the result of the self-check.
// Each device checks itself: a driver that fails during the check costs its own row only. A device
// that hangs ends the command.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>

#include "apps/common/checked_device.hpp"
#include "apps/common/options.hpp"
#include "runtime/cl/environment.hpp"
#include "runtime/files/json_text.hpp"

namespace gflow {
namespace {

std::string bytes_text(uint64_t bytes) {
  if (bytes >= (10ull << 30)) return fmt::format("{:.1f} GiB", double(bytes) / double(1ull << 30));
  if (bytes >= (10ull << 20)) return fmt::format("{} MiB", bytes >> 20);
  return fmt::format("{} KiB", bytes >> 10);
}

std::string verdict(const CheckedDevice& device) {
  return device.reason.empty() ? "usable" : "unusable: " + device.reason;
}

void print_table(const CheckedDevice& device) {
  const DeviceInfo& info = device.info;
  const auto line = [](const std::string& what, const std::string& value) {
    fmt::print("   {:<20} {}\n", what, value);
  };
  fmt::print("{}: {}\n", info.index, info.name);
  line("platform", info.platform);
  line("type", type_of(info));
  line("compute units", std::to_string(info.compute_units));
  line("memory", bytes_text(info.global_memory));
  line("largest allocation", bytes_text(info.max_allocation));
  line("local memory", bytes_text(info.local_memory));
  line("fp64", info.fp64 ? "yes" : "no (not needed)");
  line("lanes chosen",
       fmt::format("{} {}", info.lanes,
                   info.lanes == 1 ? "(one pixel per work-item)" : "pixels per work-item"));
  line("largest work-group", std::to_string(info.max_work_group));
  line("driver", info.driver);
  line("OpenCL", info.version);
  for (const SelfCheckRow& row : device.rows)
    fmt::print("   check  {:<42} {:>10.3g}  at most {:<8.3g} {}\n", row.name, row.value, row.bound,
               row.passed ? "ok" : "FAILS");
  fmt::print("   {}\n\n", verdict(device));
}

// All devices, or the one that --device selects.
std::vector<DeviceInfo> wanted_devices(const GlobalOptions& options) {
  check_environment();
  try {
    std::vector<DeviceInfo> all = list_devices();
    if (options.device.empty()) return all;
    const cl::Device wanted = find_device(options.device);
    for (const DeviceInfo& info : all)
      if (find_device(std::to_string(info.index))() == wanted()) return {info};
    return all;
  } catch (const Error& error) {
    throw NoUsableDevice(error.what());
  }
}

void run(const GlobalOptions& options, bool json) {
  std::vector<CheckedDevice> devices;
  for (const DeviceInfo& info : wanted_devices(options)) devices.push_back(checked(info));
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const CheckedDevice& device : devices) {
    if (json)
      list.push_back(as_json(device));
    else
      print_table(device);
  }
  if (json) fmt::print("{}\n", json_text(list, 2));
  const bool any_usable =
      std::any_of(devices.begin(), devices.end(),
                  [](const CheckedDevice& device) { return device.reason.empty(); });
  if (any_usable) return;
  std::fflush(stdout);
  throw NoUsableDevice(devices.size() == 1
                           ? fmt::format("device {} ({}) is unusable: {}", devices[0].info.index,
                                         devices[0].info.name, devices[0].reason)
                           : "none of the devices above is usable");
}

}  // namespace

void add_devices(CLI::App& app, const GlobalOptions& options) {
  CLI::App* command = app.add_subcommand(
      "devices", "List the OpenCL devices with their properties and a self-check of each");
  auto json = std::make_shared<bool>(false);
  command->add_flag("--json", *json, "Print JSON instead of a table");
  command->callback([&options, json] { run(options, *json); });
}

}  // namespace gflow
