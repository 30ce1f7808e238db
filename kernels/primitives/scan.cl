// SPDX-License-Identifier: Apache-2.0
// Exclusive prefix sum in three launches: the sum of each chunk, a prefix sum of those, a prefix
// sum within each chunk. One work-group of GROUP work-items per chunk. Integers without atomics,
// and one writer per element: the result does not depend on the order of work.
#include "shared/group_scan.h"

// One group per chunk: sums[chunk] = sum of its elements, in 64 bits.
kernel void scan_sums(const uint n, const uint per_chunk, global const uint* restrict in,  // [n]
                      global ulong* restrict sums) {  // [chunks]
  local ulong shared[GROUP];
  const uint begin = min(n, (uint)get_group_id(0) * per_chunk);
  const uint end = min(n, begin + per_chunk);
  ulong sum = 0, total;
  for (uint i = begin + get_local_id(0); i < end; i += GROUP) sum += in[i];
  group_scan(sum, shared, &total);
  if (get_local_id(0) == 0) sums[get_group_id(0)] = total;
}

// One group: sums become the sums of all chunks before; total[0] the sum of everything.
kernel void scan_offsets(const uint chunks, global ulong* restrict sums,  // [chunks]
                         global ulong* restrict total) {                  // [1]
  local ulong shared[GROUP];
  ulong carry = 0;
  for (uint first = 0; first < chunks; first += GROUP) {
    const uint i = first + get_local_id(0);
    const ulong value = i < chunks ? sums[i] : 0;
    ulong all;
    const ulong before = group_scan(value, shared, &all);
    if (i < chunks) sums[i] = carry + before;
    carry += all;
  }
  if (get_local_id(0) == 0) total[0] = carry;
}

// One group per chunk; the last one also writes the total's low 32 bits to out[n].
kernel void scan_write(const uint n, const uint per_chunk, global const uint* restrict in,  // [n]
                       global const ulong* restrict sums,  // [chunks]
                       global uint* restrict out) {        // [n + 1]
  local ulong shared[GROUP];
  const uint begin = min(n, (uint)get_group_id(0) * per_chunk);
  const uint end = min(n, begin + per_chunk);
  ulong carry = sums[get_group_id(0)];
  for (uint first = begin; first < end; first += GROUP) {
    const uint i = first + get_local_id(0);
    const uint value = i < end ? in[i] : 0;
    ulong all;
    const ulong before = group_scan(value, shared, &all);
    if (i < end) out[i] = (uint)(carry + before);
    carry += all;
  }
  if (get_group_id(0) == get_num_groups(0) - 1 && get_local_id(0) == 0) out[n] = (uint)carry;
}
