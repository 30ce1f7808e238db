// SPDX-License-Identifier: Apache-2.0
// Prefix sum over the GROUP work-items of one work-group (a power of two; 1 costs nothing). OpenCL
// C only. Contains barriers: every work-item of the group must call it.
#ifndef GFLOW_GROUP_SCAN_H
#define GFLOW_GROUP_SCAN_H
#include "shared/work.h"

// The sum of `value` over the work-items before this one; *total gets the sum over all of them.
static inline ulong group_scan(ulong value, local ulong* shared, ulong* total) {  // shared [GROUP]
#if GROUP == 1
  (void)shared;
  *total = value;
  return 0;
#else
  const uint l = get_local_id(0);
  shared[l] = value;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint step = 1; step < GROUP; step *= 2) {
    const ulong before = l >= step ? shared[l - step] : 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    shared[l] += before;
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  *total = shared[GROUP - 1];
  const ulong sum = shared[l] - value;
  barrier(CLK_LOCAL_MEM_FENCE);  // the next call writes to shared
  return sum;
#endif
}

#endif
