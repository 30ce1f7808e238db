// SPDX-License-Identifier: Apache-2.0
// Splats into tiles, each tile's list in depth order, ties by index. Those that are seen come
// sorted by depth once; chunks of that order are counted a tile, the counts summed over chunks and
// tiles, and the chunks scattered in order: stable, no atomics, bitwise repeatable (kernels.md 4,
// S3).
// Measured (PoCL 3.1, 2 cores, 100 000 splats, 287 000 intersections): counting .9 ms, scattering
// .9; with unsigned loops over y * tiles_x + x 1.1 each.
#include "shared/constants.h"

// The part [x, y) of n items that chunk c of `chunks` takes.
static inline uint2 chunk_range(uint n, uint c, uint chunks) {
  const uint size = (n + chunks - 1) / chunks;
  const uint first = min(n, c * size);
  return (uint2)(first, min(n, first + size));
}

// One work-item a chunk of all Gaussians: how many of them are seen. So that only they are sorted.
kernel void seen_count(const uint n, const uint chunks, global const uint* restrict tiles_touched,
                       global uint* restrict counts) {  // [chunks]
  const uint c = get_global_id(0);
  if (c >= chunks) return;
  const uint2 range = chunk_range(n, c, chunks);
  uint count = 0;
  for (uint i = range.x; i < range.y; ++i) count += tiles_touched[i] > 0;
  counts[c] = count;
}

// And who, from offsets[chunk] on, with the keys of their depth.
kernel void seen_write(const uint n, const uint chunks, global const uint* restrict tiles_touched,
                       global const uint* restrict depth_keys,  // [N]
                       global const uint* restrict offsets,     // [chunks + 1]
                       global uint* restrict keys,              // [V]
                       global uint* restrict order) {           // [V] by index
  const uint c = get_global_id(0);
  if (c >= chunks) return;
  const uint2 range = chunk_range(n, c, chunks);
  uint at = offsets[c];
  for (uint i = range.x; i < range.y; ++i)
    if (tiles_touched[i] > 0) {
      keys[at] = depth_keys[i];
      order[at++] = i;
    }
}

// One work-item a chunk of those: histogram [chunks, tiles].
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

// One work-item a tile: histogram becomes each chunk's offset within the tile; totals [tiles].
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

// One work-item a chunk. A Gaussian's intersections have consecutive slots, so that the backward
// pass can be summed a Gaussian at a time.
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
