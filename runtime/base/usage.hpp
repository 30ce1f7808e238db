// SPDX-License-Identifier: Apache-2.0
// What this process has cost so far.
#pragma once

namespace gflow {

// Of all its threads [s].
double cpu_seconds();
// Of the thread that asks [s].
double thread_cpu_seconds();
// Most memory it had at once, since begin_peak_memory() if that was called [MiB]; with a device
// that has none of its own, such as a CPU, the device's buffers are in it.
double peak_memory_mib();
// From now on. Linux alone can; elsewhere it stays that of the whole process.
void begin_peak_memory();

}  // namespace gflow
