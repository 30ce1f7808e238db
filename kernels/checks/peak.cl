// SPDX-License-Identifier: Apache-2.0
// The peak throughput of a device, in fused multiply-adds and in copying, for comparison.
#include "shared/lane.h"

#define CHAINS 12  // independent ones hide the latency of an FMA; measured best on Zen 4

// 2 CHAINS LANES `rounds` operations per work-item.
kernel void peak_fma(const int rounds, const float a, const float b, global float* restrict out) {
  const uint id = get_global_id(0);
  lane x[CHAINS];
  const lane by = TO_LANE(a), add = TO_LANE(b);
#pragma unroll
  for (int k = 0; k < CHAINS; ++k) x[k] = TO_LANE((float)(id + k));
  for (int i = 0; i < rounds; ++i) {
#pragma unroll
    for (int k = 0; k < CHAINS; ++k) x[k] = fma(x[k], by, add);
  }
  lane sum = x[0];
#pragma unroll
  for (int k = 1; k < CHAINS; ++k) sum += x[k];
#if LANES > 1
  out[id] = lane_sum(sum);
#else
  out[id] = sum;
#endif
}

// 16 floats per work-item.
kernel void peak_copy(global const float* restrict from, global float* restrict to) {
  const uint id = get_global_id(0);
  vstore16(vload16(id, from), id, to);
}
