// SPDX-License-Identifier: Apache-2.0
// The device for tests: GFLOW_DEVICE, else the first GPU, else the first device.
#pragma once
#include "runtime/cl/queue.hpp"

namespace gflow {

// A queue whose pixel kernels process `lanes` pixels per work-item; 0: what suits the device.
inline Queue test_queue(int lanes = 0) {
  QueueOptions options;
  options.lanes = lanes;
  return Queue(find_device(), options);
}

}  // namespace gflow
