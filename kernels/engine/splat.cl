// SPDX-License-Identifier: Apache-2.0
// From splats to the image and back: kernels of both directions, for CPUs in splat_lanes.cl and for
// GPUs in splat_pixels.cl, over the maths of shared/pixel.h. No atomics: bitwise repeatable.
//   splat_fwd  every pixel blends its tile's splats front to back, with colour, depth and flow in
//              one pass and without lists per pixel
//   splat_bwd  every tile processes its list back to front, from where the last of its pixels was
//              saturated, and each intersection stores its 16 sums in its own slot
//   gather     adds the slots of a Gaussian in order
// An image with flow may be split between the programs with and without FLOW (`shared`): forward,
// the former draws the tiles in with_flow, the latter the others and their flow of 0; backward, the
// former takes the tiles whose v_flow is not 0 (Skips::flow, View::flow_tiles).
#include "shared/pixel_grads.h"

// 1: the backward pass skips cells of pixels whose incoming gradients are all 0
// (Skips::zero_gradients).
#ifndef ASKING
#define ASKING 1
#endif

#if LANES == 1
#include "engine/splat_pixels.cl"
#else
#include "engine/splat_lanes.cl"
#endif

// Which tiles of a shared image have flow: those of View::flow_tiles (all, unless `chosen`) that
// list a splat below `moving`. One work-item per tile.
kernel void tiles_with_flow(const uint tiles, const uint moving, const int chosen,
                            global const float* restrict flow_tiles,   // [tiles]
                            global const uint* restrict tile_offsets,  // [tiles + 1]
                            global const uint* restrict isect_ids,     // [M]
                            global uchar* restrict with_flow) {        // [tiles]
  const uint tile = get_global_id(0);
  if (tile >= tiles) return;
  uchar moves = 0;
  if (!chosen || flow_tiles[tile] != 0.f)
    for (uint k = tile_offsets[tile]; k < tile_offsets[tile + 1] && !moves; ++k)
      moves = isect_ids[k] < moving;
  with_flow[tile] = moves;
}

// One work-item per Gaussian: sums its slots in order. Rows that are not visible are unchanged.
kernel void gather(const uint n, global const uint* restrict slot_offsets,  // [N + 1]
                   global const float* restrict partials,                   // [M, 16]
                   global float* restrict moments) {                        // [N, 16]
  const uint i = get_global_id(0);
  if (i >= n) return;
  const uint end = slot_offsets[i + 1];
  uint slot = slot_offsets[i];
  if (slot == end) return;  // not visible
  float8 low = (float8)(0.f), high = (float8)(0.f);
  for (; slot < end; ++slot) {
    low += vload8(2 * (size_t)slot, partials);
    high += vload8(2 * (size_t)slot + 1, partials);
  }
  vstore8(low, 2 * (size_t)i, moments);
  vstore8(high, 2 * (size_t)i + 1, moments);
}
