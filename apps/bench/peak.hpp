// SPDX-License-Identifier: Apache-2.0
// The most a device can do, measured in the same process as what is compared with it.
#pragma once
#include "runtime/cl/queue.hpp"

namespace gflow::bench {

struct Peak {
  double gflops = 0;    // fused multiply-adds of the pixel kernels' vectors, two operations each
  double copy_gbs = 0;  // bytes read and written by a copy of 64 MiB [1e9 bytes / s]
};

// The best of nine runs of kernels/peak.cl each, by wall time.
Peak measure_peak(Queue& queue);

}  // namespace gflow::bench
