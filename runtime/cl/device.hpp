// SPDX-License-Identifier: Apache-2.0
// The OpenCL devices, their properties, and which one the user means. What depends on the kind of
// device is decided here (lanes_for).
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "runtime/cl/cl_error.hpp"

namespace gflow {

// The properties of a device that gflow uses or prints.
struct DeviceInfo {
  int index = -1;  // position in list_devices(); -1: made from a bare cl::Device
  std::string platform, name, driver, version;
  bool is_cpu = false, is_gpu = false;
  bool fp64 = false;
  bool has_compiler = false;
  uint32_t compute_units = 0;
  uint64_t global_memory = 0, max_allocation = 0, local_memory = 0;  // [bytes]
  size_t max_work_group = 0;                                         // work-items
  int native_vector_width = 0;                                       // floats in a register
  int lanes = 1;  // vector width of the pixel kernels [pixels]: 16, 8, 4 or 1

  std::string full_name() const { return platform + " / " + name; }
};

// Queries a device.
DeviceInfo device_info(const cl::Device& device, int index = -1);
// PoCL keeps compiled programs itself, in a folder of its own (pocl_cache.hpp).
bool is_pocl(const DeviceInfo& info);

// Vector width of pixel maths: 4 to 16 with one tile per work-item, 1 with one pixel per work-item.
int lanes_for(const DeviceInfo& info);

// Every device of every platform, in the loader's order. Error if there is none.
std::vector<DeviceInfo> list_devices();

// The device meant by `wanted`: an index into list_devices() or a part of "platform / name", case
// ignored. If empty, $GFLOW_DEVICE, else the first GPU, else the first device. Error that lists the
// devices if none matches.
cl::Device find_device(const std::string& wanted = "");

// Error with the reason if the device cannot run gflow's kernels with this vector width.
void require_usable(const DeviceInfo& info, int lanes);

}  // namespace gflow
