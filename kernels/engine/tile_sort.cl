// SPDX-License-Identifier: Apache-2.0
// bin.cl's lists as a GPU makes them: a (tile, slot) pair for each intersection, in depth order,
// stably sorted by tile (sort.cl). Every step has one work-item per element, so that large splats
// do not hold up others.
#include "shared/work.h"

#if GROUP > 1

// Index of the first element of ascending `sorted` that is not less than `value`.
static inline uint lower_bound(global const uint* sorted, uint n, uint value) {
  uint low = 0, high = n;
  while (low < high) {
    const uint middle = low + (high - low) / 2;
    if (sorted[middle] < value)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

// One work-item per visible Gaussian, nearest first.
kernel void tiles_in_order(const uint n, global const uint* restrict order,
                           global const uint* restrict tiles_touched,
                           global uint* restrict counts) {  // [V]
  const uint k = get_global_id(0);
  if (k < n) counts[k] = tiles_touched[order[k]];
}

// One work-item per intersection; those of the k-th nearest Gaussian begin at starts[k].
kernel void tile_pairs(const uint total, const uint n, const uint tiles_x,
                       global const uint* restrict starts,  // [V + 1]
                       global const uint* restrict order,   // [V]
                       global const ushort* restrict tile_boxes,    // [N, 4]
                       global const uint* restrict slot_offsets,    // [N + 1]
                       global uint* restrict tiles,                 // [M]
                       global uint* restrict slots,                 // [M]
                       global uint* restrict owners) {              // [M] Gaussian of each slot
  const uint p = get_global_id(0);
  if (p >= total) return;
  const uint k = lower_bound(starts, n + 1, p + 1) - 1;
  const uint id = order[k], among_its = p - starts[k];
  const ushort4 box = vload4(id, tile_boxes);
  const uint across = box.z - box.x + 1;
  const uint slot = slot_offsets[id] + among_its;
  tiles[p] = (box.y + among_its / across) * tiles_x + box.x + among_its % across;
  slots[p] = slot;
  owners[slot] = id;
}

// One work-item per intersection of the sorted list.
kernel void tile_ids(const uint total, global const uint* restrict isect_slots,  // [M]
                     global const uint* restrict owners,                         // [M]
                     global uint* restrict isect_ids) {                          // [M]
  const uint p = get_global_id(0);
  if (p < total) isect_ids[p] = owners[isect_slots[p]];
}

// One work-item per tile, and one more.
kernel void tile_starts(const uint count, const uint total,
                        global const uint* restrict tiles,   // [M] ascending
                        global uint* restrict tile_offsets) {  // [count + 1]
  const uint t = get_global_id(0);
  if (t <= count) tile_offsets[t] = lower_bound(tiles, total, t);
}

#endif
