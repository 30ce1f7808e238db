// SPDX-License-Identifier: Apache-2.0
// The devices with the results of their self-checks, as `gflow devices` and Python's
// gflow.devices() list them.
#pragma once
#include <nlohmann/json.hpp>
#include <string>

#include "optim/engine/self_check.hpp"

namespace gflow {

struct CheckedDevice {
  DeviceInfo info;
  SelfCheck rows;
  std::string reason;  // why the device is unusable; empty if it is usable
};

// Opens and checks a device of list_devices(). A driver that fails makes it unusable.
CheckedDevice checked(const DeviceInfo& info);

// "CPU", "GPU" or "other".
std::string type_of(const DeviceInfo& info);

// An entry of `gflow devices --json`.
nlohmann::ordered_json as_json(const CheckedDevice& device);

}  // namespace gflow
