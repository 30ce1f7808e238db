// SPDX-License-Identifier: Apache-2.0
// Resources that this process has used.
#pragma once

namespace gflow {

// CPU time of all threads [s].
double cpu_seconds();
// CPU time of the calling thread [s].
double thread_cpu_seconds();
// Peak memory, since begin_peak_memory() if that was called [MiB]. Includes the device's buffers if
// the device has no memory of its own, such as a CPU.
double peak_memory_mib();
// Restarts the peak from now on. Linux only; elsewhere it stays that of the whole process.
void begin_peak_memory();

}  // namespace gflow
