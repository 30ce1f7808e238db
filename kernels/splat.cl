// SPDX-License-Identifier: Apache-2.0
// Draws the image: every pixel blends its tile's splats front to back, with colour, depth and flow
// in one pass and without lists per pixel. Repeatable: each pixel sums in depth order.
//   LANES > 1   one work-item (group of 1) per tile; splats outer, touched cells inner
//   LANES == 1  one work-group of 256 per tile, one work-item per pixel, splats in local memory
// An image with flow may be split between the programs with and without FLOW (`shared`): the former
// draws the tiles in with_flow, the latter the others and their flow of 0.
// Fastest on PoCL: prefetching splats, and computing the next footprint before blending the last.
#include "shared/pixel.h"

#define BATCH 64  // LANES == 1: splats in local memory at a time

#if LANES > 1
static inline void cell_blend(PixelSums* sums, Splat s, CellFootprint at, int entry) {
#pragma unroll
  for (int part = 0; part < CELL_PARTS; ++part)
    sums[part] = pixel_blend(sums[part], s, at.part[part], entry);
}
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

kernel void splat_fwd(const int width, const int height, const int shared,
                      global const uchar* restrict with_flow,  // [tiles] read if shared
                      const float background_r,
                      const float background_g, const float background_b,
                      global const float* restrict splats,      // [N, 16]
                      global const uint* restrict tile_offsets,  // [tiles + 1]
                      global const uint* restrict isect_ids,     // [M]
                      global const ushort* restrict masks,       // [M]
                      global float* restrict rgb,                // [3, H, W]
                      global float* restrict alpha,              // [H, W]
                      global float* restrict depth,              // [H, W] sum of w Z
                      global float* restrict flow,               // [2, H, W] sum w f / sum w
                      global float* restrict flow_weight,        // [H, W] sum w of the first TOP_K
                      global float* restrict transmittance,      // [H, W] behind all splats
                      global int* restrict ends) {  // [H, W] entries of the tile's list until a
                                                    // pixel is saturated; with TOP_K [2, H, W],
                                                    // also until its flow is complete
  const int tiles_x = (width + TILE - 1) / TILE;
  const int tile = get_group_id(0);
  const int x0 = tile % tiles_x * TILE, y0 = tile / tiles_x * TILE;
  const size_t pixels = (size_t)width * height;
  const int ours = !shared || with_flow[tile] == FLOW;
  const uint first = tile_offsets[tile], end = ours ? tile_offsets[tile + 1] : first;
#if LANES == 1
  // A tile of the other program continues with an empty list: after a return here PoCL 3.1 loses
  // track of which pixels are inside the image.
  local float4 batch[BATCH * 4];
  local ushort batch_mask[BATCH];
  local int open_pixels[2];
  const int l = get_local_id(0), cell = l >> 4;
  const int x = x0 + (cell & 3) * CELL + (l & 3), y = y0 + (cell >> 2) * CELL + ((l >> 2) & 3);
  PixelSums p = pixel_start();
  if (l < 2) open_pixels[l] = 1;
  barrier(CLK_LOCAL_MEM_FENCE);
  int turn = 0;
  for (uint start = first; start < end; start += BATCH, turn ^= 1) {
    if (SATURATED && !open_pixels[turn]) break;  // the same for the whole group
    const uint count = min((uint)BATCH, end - start);
    if ((uint)(l >> 2) < count)
      batch[l] = vload4(4 * isect_ids[start + (l >> 2)] + (l & 3), splats);
    if ((uint)l < count) batch_mask[l] = masks[start + l];
    barrier(CLK_LOCAL_MEM_FENCE);
    if (l == 0) open_pixels[turn ^ 1] = 0;
    for (uint k = 0; k < count; ++k) {
      if (!(batch_mask[k] >> cell & 1)) continue;
      Splat s;
      s.a = batch[4 * k];
      s.b = batch[4 * k + 1];
      s.c = batch[4 * k + 2];
      s.d = batch[4 * k + 3];
      p = pixel_blend(p, s, footprint(s, (float)x + 0.5f - s.a.x, (float)y + 0.5f - s.a.y),
                      (int)(start - first + k) + 1);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (still_open(p.T) && x < width && y < height) open_pixels[turn ^ 1] = 1;
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  if (!ours || x >= width || y >= height) return;
  const size_t at = (size_t)y * width + x;
  const float T = fabs(p.T);
  rgb[at] = fma(T, background_r, p.r);
  rgb[pixels + at] = fma(T, background_g, p.g);
  rgb[2 * pixels + at] = fma(T, background_b, p.b);
  alpha[at] = p.W;
  transmittance[at] = T;
  ends[at] = p.end;
#if DEPTH
  depth[at] = p.depth;
#endif
#if FLOW
#if TOP_K
  const float W = p.W_flow;
  flow_weight[at] = W;
  ends[pixels + at] = p.flow_end;
#else
  const float W = p.W;
#endif
  flow[at] = W > 0.f ? p.fx / W : 0.f;
  flow[pixels + at] = W > 0.f ? p.fy / W : 0.f;
#else
  if (shared) flow[at] = flow[pixels + at] = 0.f;
#endif
#else
  if (!ours) return;
  PixelSums sums[TILE_PARTS];
  for (int i = 0; i < TILE_PARTS; ++i) sums[i] = pixel_start();
  for (uint k = first; k < end; ++k) {
    READ_SOON(splats + 16 * (size_t)isect_ids[min(k + 8, end - 1)]);
    uint mask = masks[k];
    if (mask) {
      const Splat s = splat_load(splats, isect_ids[k]);
      const TileFrame f = tile_frame(s, x0, y0);
      const int entry = (int)(k - first) + 1;
      int cell = next_cell(&mask);
      CellFootprint at = cell_footprint(s, &f, cell);
      while (mask) {  // the next footprint hides the latency of this one's sums
        const CellFootprint now = at;
        const int i = cell;
        cell = next_cell(&mask);
        at = cell_footprint(s, &f, cell);
        cell_blend(sums + i * CELL_PARTS, s, now, entry);
      }
      cell_blend(sums + cell * CELL_PARTS, s, at, entry);
    }
    if (SATURATED && ((k - first) & 31) == 31) {
      lane most = sums[0].T;
      for (int i = 1; i < TILE_PARTS; ++i) most = fmax(most, sums[i].T);
      if (!lane_any(still_open(most))) break;
    }
  }
  for (int i = 0; i < TILE_PARTS; ++i) {
    const int cell = i / CELL_PARTS, x = x0 + (cell & 3) * CELL;
    const int y = y0 + (cell >> 2) * CELL + i % CELL_PARTS * LANE_ROWS;
    const PixelSums p = sums[i];
    const lane T = fabs(p.T);
    lane_store(fma(T, TO_LANE(background_r), p.r), rgb, x, y, width, height);
    lane_store(fma(T, TO_LANE(background_g), p.g), rgb + pixels, x, y, width, height);
    lane_store(fma(T, TO_LANE(background_b), p.b), rgb + 2 * pixels, x, y, width, height);
    lane_store(p.W, alpha, x, y, width, height);
    lane_store(T, transmittance, x, y, width, height);
    lane_store_int(p.end, ends, x, y, width, height);
#if DEPTH
    lane_store(p.depth, depth, x, y, width, height);
#endif
#if FLOW
#if TOP_K
    const lane W = p.W_flow;
    lane_store(W, flow_weight, x, y, width, height);
    lane_store_int(p.flow_end, ends + pixels, x, y, width, height);
#else
    const lane W = p.W;
#endif
    const lane zero = TO_LANE(0.f);
    lane_store(LANE_SELECT(zero, p.fx / W, W > zero), flow, x, y, width, height);
    lane_store(LANE_SELECT(zero, p.fy / W, W > zero), flow + pixels, x, y, width, height);
#else
    if (shared) {
      lane_store(TO_LANE(0.f), flow, x, y, width, height);
      lane_store(TO_LANE(0.f), flow + pixels, x, y, width, height);
    }
#endif
  }
#endif
}
