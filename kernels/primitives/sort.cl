// SPDX-License-Identifier: Apache-2.0
// One pass of a stable radix sort by a digit of SORT_BITS: count digits per chunk, turn the counts
// into offsets (scan.cl), scatter. One work-group of GROUP work-items per chunk. Stable, hence
// repeatable: elements keep their order within a chunk, and chunks follow each other. On CPUs
// 11-bit digits are faster than 8-bit ones up to about a million keys; beyond, 2048 places to write
// to are too many.
#include "shared/work.h"

#define DIGITS (1 << SORT_BITS(GROUP))

// counts is digit-major, so that its prefix sum is where each (digit, chunk) begins.
kernel void sort_count(const uint n, const uint per_chunk, const uint shift, const uint mask,
                       global const uint* restrict keys,  // [n]
                       global uint* restrict counts) {    // [DIGITS, chunks]
  const uint chunk = get_group_id(0), chunks = get_num_groups(0);
  const uint begin = min(n, chunk * per_chunk), end = min(n, begin + per_chunk);
#if GROUP == 1
  uint count[DIGITS];
  for (uint d = 0; d < DIGITS; ++d) count[d] = 0;
  for (uint i = begin; i < end; ++i) ++count[keys[i] >> shift & mask];
  for (uint d = 0; d < DIGITS; ++d) counts[d * chunks + chunk] = count[d];
#else
  local uint count[DIGITS];
  const uint l = get_local_id(0);
  for (uint d = l; d < DIGITS; d += GROUP) count[d] = 0;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint i = begin + l; i < end; i += GROUP) atomic_inc(&count[keys[i] >> shift & mask]);
  barrier(CLK_LOCAL_MEM_FENCE);
  for (uint d = l; d < DIGITS; d += GROUP) counts[d * chunks + chunk] = count[d];
#endif
}

#if GROUP == 1

kernel void sort_scatter(const uint n, const uint per_chunk, const uint shift, const uint mask,
                         global const uint* restrict keys,     // [n]
                         global const uint* restrict values,   // [n]
                         global const uint* restrict offsets,  // [DIGITS, chunks]
                         global uint* restrict out_keys,       // [n]
                         global uint* restrict out_values) {   // [n]
  const uint chunk = get_group_id(0), chunks = get_num_groups(0);
  const uint begin = min(n, chunk * per_chunk), end = min(n, begin + per_chunk);
  uint next[DIGITS];
  for (uint d = 0; d < DIGITS; ++d) next[d] = offsets[d * chunks + chunk];
  for (uint i = begin; i < end; ++i) {
    const uint key = keys[i];
    const uint to = next[key >> shift & mask]++;
    out_keys[to] = key;
    out_values[to] = values[i];
  }
}

#else

// The chunk is taken in tiles of GROUP elements. An element's place is where its digit begins in
// the output plus the number of equal digits before it in the tile, counted by comparing with all
// of them: two barriers per tile, far fewer than a sort by one bit after the other.
kernel void sort_scatter(const uint n, const uint per_chunk, const uint shift, const uint mask,
                         global const uint* restrict keys,     // [n]
                         global const uint* restrict values,   // [n]
                         global const uint* restrict offsets,  // [DIGITS, chunks]
                         global uint* restrict out_keys,       // [n]
                         global uint* restrict out_values) {   // [n]
  local uint digits[GROUP], next[DIGITS];
  const uint l = get_local_id(0);
  const uint chunk = get_group_id(0), chunks = get_num_groups(0);
  const uint begin = min(n, chunk * per_chunk), end = min(n, begin + per_chunk);
  for (uint d = l; d < DIGITS; d += GROUP) next[d] = offsets[d * chunks + chunk];
  for (uint first = begin; first < end; first += GROUP) {
    const int here = first + l < end;
    const uint key = here ? keys[first + l] : 0;
    const uint digit = here ? key >> shift & mask : DIGITS;  // past the end: no digit
    digits[l] = digit;
    barrier(CLK_LOCAL_MEM_FENCE);
    int4 before = (int4)(0), all = (int4)(0);  // counted downwards: true is -1
#pragma unroll 4  // all 64 iterations at once spill registers (AMD's compiler)
    for (uint k = 0; k < GROUP / 4; ++k) {
      const int4 same = vload4(k, digits) == (uint4)(digit);
      before += same & ((uint4)(4 * k) + (uint4)(0, 1, 2, 3) < (uint4)(l));
      all += same;
    }
    const uint rank = (uint)-(before.x + before.y + before.z + before.w);
    const uint count = (uint)-(all.x + all.y + all.z + all.w);
    if (here) {
      const uint to = next[digit] + rank;
      out_keys[to] = key;
      out_values[to] = values[first + l];
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (here && rank + 1 == count) next[digit] += count;
  }
}

#endif
