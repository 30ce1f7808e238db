// SPDX-License-Identifier: Apache-2.0
// The variables by which a user changes how gflow uses a device.
#pragma once

namespace gflow {

// Whether a variable is 1 and not 0; `otherwise` where it is not set or empty. Error for all else.
bool is_wanted(const char* variable, bool otherwise);

// Error where GFLOW_COMPILE_AHEAD, GFLOW_DEVICE_TIMEOUT, GFLOW_KERNEL_DIR, GFLOW_POISON_BUFFERS or
// GFLOW_SYNC is what it cannot be: to be told before a device is asked for, which is not to blame.
void check_environment();

}  // namespace gflow
