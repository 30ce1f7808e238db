// SPDX-License-Identifier: Apache-2.0
// Puts splats into tiles, each tile's list in depth order, ties by index; without atomics, bitwise
// repeatable. The visible ones are sorted by depth once. On CPUs, chunks of that order are then
// counted per tile, the counts summed over chunks and tiles, and the chunks scattered in order; a
// GPU sorts (tile, slot) pairs instead (tile_sort.cl). The lists are the same. Signed loops over
// row pointers are faster on PoCL than unsigned ones over y * tiles_x + x.
#include "shared/constants.h"
#include "shared/group_scan.h"

// The range [x, y) of n items in chunk c of `chunks`.
static inline uint2 chunk_range(uint n, uint c, uint chunks) {
  const uint size = (n + chunks - 1) / chunks;
  const uint first = min(n, c * size);
  return (uint2)(first, min(n, first + size));
}

// Counts the visible Gaussians, so that only they are sorted. One group per chunk of all Gaussians.
kernel void seen_count(const uint n, global const uint* restrict tiles_touched,
                       global uint* restrict counts) {  // [chunks]
  local ulong shared[GROUP];
  const uint2 range = chunk_range(n, get_group_id(0), get_num_groups(0));
  uint count = 0;
  for (uint i = range.x + get_local_id(0); i < range.y; i += GROUP) count += tiles_touched[i] > 0;
  ulong all;
  group_scan(count, shared, &all);
  if (get_local_id(0) == 0) counts[get_group_id(0)] = (uint)all;
}

// Writes the visible Gaussians and their depth keys, from offsets[chunk] on.
kernel void seen_write(const uint n, global const uint* restrict tiles_touched,
                       global const uint* restrict depth_keys,  // [N]
                       global const uint* restrict offsets,     // [chunks + 1]
                       global uint* restrict keys,              // [V]
                       global uint* restrict order) {           // [V] by index
  local ulong shared[GROUP];
  const uint2 range = chunk_range(n, get_group_id(0), get_num_groups(0));
  uint at = offsets[get_group_id(0)];
  for (uint first = range.x; first < range.y; first += GROUP) {
    const uint i = first + get_local_id(0);
    const int seen = i < range.y && tiles_touched[i] > 0;
    ulong all;
    const uint before = (uint)group_scan((ulong)seen, shared, &all);
    if (seen) {
      keys[at + before] = depth_keys[i];
      order[at + before] = i;
    }
    at += (uint)all;
  }
}

#if GROUP == 1

// One work-item per chunk of visible Gaussians: histogram [chunks, tiles].
kernel void tile_count(const uint n, const uint chunks, const uint tiles_x, const uint tiles,
                       global const uint* restrict order,         // [n] by depth
                       global const ushort* restrict tile_boxes,  // [N, 4]
                       global uint* restrict histogram) {
  const uint c = get_global_id(0);
  if (c >= chunks) return;
  global uint* h = histogram + (size_t)c * tiles;
  for (uint t = 0; t < tiles; ++t) h[t] = 0;
  const uint2 range = chunk_range(n, c, chunks);
  for (uint k = range.x; k < range.y; ++k) {
    const ushort4 box = vload4(order[k], tile_boxes);
    const int x0 = box.x, x1 = box.z, y1 = box.w;
    for (int y = box.y; y <= y1; ++y) {
      global uint* row = h + y * (int)tiles_x;
      for (int x = x0; x <= x1; ++x) ++row[x];
    }
  }
}

// One work-item per tile: turns histogram into each chunk's offset within the tile; totals [tiles].
kernel void tile_columns(const uint chunks, const uint tiles, global uint* restrict histogram,
                         global uint* restrict totals) {
  const uint t = get_global_id(0);
  if (t >= tiles) return;
  uint sum = 0;
  for (uint c = 0; c < chunks; ++c) {
    const uint count = histogram[(size_t)c * tiles + t];
    histogram[(size_t)c * tiles + t] = sum;
    sum += count;
  }
  totals[t] = sum;
}

// One work-item per chunk. A Gaussian's intersections have consecutive slots, so that the backward
// pass can sum them per Gaussian.
kernel void tile_scatter(const uint n, const uint chunks, const uint tiles_x, const uint tiles,
                         global const uint* restrict order,
                         global const ushort* restrict tile_boxes,
                         global const uint* restrict slot_offsets,  // [N + 1]
                         global const uint* restrict tile_offsets,  // [tiles + 1]
                         global uint* restrict histogram,
                         global uint* restrict isect_ids,      // [M] Gaussian
                         global uint* restrict isect_slots) {  // [M]
  const uint c = get_global_id(0);
  if (c >= chunks) return;
  global uint* h = histogram + (size_t)c * tiles;
  for (uint t = 0; t < tiles; ++t) h[t] += tile_offsets[t];
  const uint2 range = chunk_range(n, c, chunks);
  for (uint k = range.x; k < range.y; ++k) {
    const uint id = order[k];
    const ushort4 box = vload4(id, tile_boxes);
    uint slot = slot_offsets[id];
    const int x0 = box.x, x1 = box.z, y1 = box.w;
    for (int y = box.y; y <= y1; ++y) {
      global uint* row = h + y * (int)tiles_x;
      for (int x = x0; x <= x1; ++x) {
        const uint at = row[x]++;
        isect_ids[at] = id;
        isect_slots[at] = slot++;
      }
    }
  }
}

#endif
