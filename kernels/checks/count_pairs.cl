// SPDX-License-Identifier: Apache-2.0
// Counts the (pixel, splat) pairs that splat_fwd and splat_bwd process, for `gflow bench`. One
// work-item per pixel.
#undef LANES  // the device's
#define LANES 1
#include "shared/pixel.h"

kernel void count_pairs(const int width, const int height,
                        global const float* restrict splats,       // [N, 16]
                        global const uint* restrict tile_offsets,  // [tiles + 1]
                        global const uint* restrict isect_ids,     // [M]
                        global const ushort* restrict masks,       // [M]
                        global const uint* restrict ends,          // [tiles] entries processed
                        global const ushort* restrict cells,       // [tiles] cells processed
                        global uint* restrict listed,              // [H, W] in its tile's list
                        global uint* restrict masked,              // [H, W] of those, in its cell
                        global uint* restrict blended,             // [H, W] of those, in its colour
                        global uint* restrict open) {              // [H, W] entries until saturated
  const int x = get_global_id(0), y = get_global_id(1);
  if (x >= width || y >= height) return;
  const int tiles_x = (width + TILE - 1) / TILE, tile = y / TILE * tiles_x + x / TILE;
  const int cell = y % TILE / CELL * (TILE / CELL) + x % TILE / CELL;
  uint in_cell = 0, in_color = 0, still = 0;
  const uint first = tile_offsets[tile], count = ends[tile];
  lane T = TO_LANE(1.f);
  for (uint j = 0; j < count; ++j) {
    const uint k = first + j;
    if (still_open(T)) still = j + 1;
    if (!((masks[k] & cells[tile]) >> cell & 1)) continue;
    ++in_cell;
    const Splat s = splat_load(splats, isect_ids[k]);
    const Coverage c = cover(footprint(s, (float)x + 0.5f - s.a.x, (float)y + 0.5f - s.a.y), T);
    T = c.T;
    in_color += c.alpha > 0.f;
  }
  const size_t at = (size_t)y * width + x;
  listed[at] = count;
  masked[at] = in_cell;
  blended[at] = in_color;
  open[at] = still;
}
