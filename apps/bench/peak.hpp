// SPDX-License-Identifier: Apache-2.0
// Peak rates of a device, measured in the same process as what is compared with them.
#pragma once
#include "runtime/cl/queue.hpp"

namespace gflow::bench {

struct Peak {
  double gflops = 0;    // FMAs on the pixel kernels' vectors, two operations each [1e9/s]
  double copy_gbs = 0;  // bytes read and written by a copy [1e9 bytes/s]
};

// The best of nine runs each of the kernels in kernels/checks/peak.cl, by wall time.
Peak measure_peak(Queue& queue);

}  // namespace gflow::bench
