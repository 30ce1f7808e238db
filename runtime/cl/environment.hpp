// SPDX-License-Identifier: Apache-2.0
// Environment variables that change how gflow uses a device.
#pragma once

namespace gflow {

// true for 1, false for 0, `otherwise` if the variable is unset or empty. Error for anything else.
bool environment_flag(const char* variable, bool otherwise);

// Error if GFLOW_COMPILE_AHEAD, GFLOW_DEVICE_TIMEOUT, GFLOW_KERNEL_DIR, GFLOW_POISON_BUFFERS or
// GFLOW_SYNC has an invalid value. To be called before a device is opened, which is not to blame.
void check_environment();

}  // namespace gflow
