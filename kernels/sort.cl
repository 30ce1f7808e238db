// SPDX-License-Identifier: Apache-2.0
// One pass of a stable radix sort by a digit of SORT_BITS: count digits per chunk, (scan.cl makes
// the counts offsets,) scatter. One work-group of GROUP work-items per chunk. Stable, hence
// repeatable: within a chunk elements keep their order, and chunks follow each other.
// Measured (PoCL 3.1, 2 cores, 100 000 keys of 32 bits): 0.95 ms with 11-bit digits, 1.3 with 8.
// From about a million keys on, 8 bits win by a fifth: 2048 places written to are too many.
#include "shared/group_scan.h"
#include "shared/work.h"

#define DIGITS (1 << SORT_BITS(GROUP))

// counts is laid out digit-major, so that its prefix sum is where each (digit, chunk) begins.
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

// The chunk is taken in tiles of GROUP elements. A tile is sorted in local memory bit by bit; then
// an element's place is where its digit stands in the output + its distance from the first
// element of the tile with that digit.
kernel void sort_scatter(const uint n, const uint per_chunk, const uint shift, const uint mask,
                         global const uint* restrict keys,     // [n]
                         global const uint* restrict values,   // [n]
                         global const uint* restrict offsets,  // [DIGITS, chunks]
                         global uint* restrict out_keys,       // [n]
                         global uint* restrict out_values) {   // [n]
  local ulong shared[GROUP];
  local uint tile_keys[GROUP], tile_values[GROUP];
  local uint next[DIGITS], first_of[DIGITS];
  const uint l = get_local_id(0);
  const uint chunk = get_group_id(0), chunks = get_num_groups(0);
  const uint begin = min(n, chunk * per_chunk), end = min(n, begin + per_chunk);
  for (uint d = l; d < DIGITS; d += GROUP) next[d] = offsets[d * chunks + chunk];
  for (uint first = begin; first < end; first += GROUP) {
    const uint count = min((uint)GROUP, end - first);
    // Past the end: the greatest key; stability keeps it behind all elements of the tile.
    uint key = l < count ? keys[first + l] : 0xffffffffu;
    uint value = l < count ? values[first + l] : 0;
    for (uint bit = shift; mask >> (bit - shift) != 0; ++bit) {
      const uint one = key >> bit & 1;
      ulong zeros;
      const uint zeros_before = (uint)group_scan(1 - one, shared, &zeros);
      const uint to = one ? (uint)zeros + l - zeros_before : zeros_before;
      tile_keys[to] = key;
      tile_values[to] = value;
      barrier(CLK_LOCAL_MEM_FENCE);
      key = tile_keys[l];
      value = tile_values[l];
      barrier(CLK_LOCAL_MEM_FENCE);
    }
    const uint digit = key >> shift & mask;
    if (l == 0 || (tile_keys[l - 1] >> shift & mask) != digit) first_of[digit] = l;
    barrier(CLK_LOCAL_MEM_FENCE);
    const uint rank = l - first_of[digit];
    if (l < count) {
      out_keys[next[digit] + rank] = key;
      out_values[next[digit] + rank] = value;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (l < count && (l == count - 1 || (tile_keys[l + 1] >> shift & mask) != digit))
      next[digit] += rank + 1;
    barrier(CLK_LOCAL_MEM_FENCE);
  }
}

#endif
