// SPDX-License-Identifier: Apache-2.0
// splat.cl for GPUs: a work-group per tile, splats in local memory. Forward one work-item per pixel
// (groups of 256), backward one per row of four pixels in a cell (groups of 64).
#include "shared/pixel_grads.h"

#define BATCH 64  // splats in local memory at a time
// Backward: splats between two barriers; rows of four pixels in a tile, one per work-item; floats
// per row in local memory, with one more so that rows use different banks.
#define BATCH_BWD 4
#define TILE_ROWS 64
#define ROW_STRIDE (MOMENTS + 1)

kernel void splat_fwd(const int width, const int height, const int shared,
                      global const uchar* restrict with_flow,  // [tiles] read if shared
                      const float background_r, const float background_g, const float background_b,
                      global const float* restrict splats,       // [N, 16]
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
}

// A pixel outside the image.
static inline PixelGrads grads_none(void) {
  PixelGrads p = {0};
  return p;
}

kernel void splat_bwd(const int width, const int height, const int shared,
                      global const float* restrict splats, global const uint* restrict tile_offsets,
                      global const uint* restrict isect_ids,
                      global const uint* restrict isect_slots,  // [M]
                      global const ushort* restrict masks, const float background_r,
                      const float background_g, const float background_b,
                      global const float* restrict alpha, global const float* restrict flow,
                      global const float* restrict flow_weight,
                      global const float* restrict transmittance, global const int* restrict ends,
                      global const float* restrict v_rgb, global const float* restrict v_alpha,
                      global const float* restrict v_depth, global const float* restrict v_flow,
                      global float* restrict partials) {  // [M, 16]
  const int tiles_x = (width + TILE - 1) / TILE;
  const int tile = get_group_id(0);
  const int x0 = tile % tiles_x * TILE, y0 = tile / tiles_x * TILE;
  const uint first = tile_offsets[tile], end = tile_offsets[tile + 1];
  const float3 background = (float3)(background_r, background_g, background_b);
  uint with_gradient = 0;                         // cells with gradients, one bit each
  int stop = SATURATED ? 0 : (int)(end - first);  // entries until all pixels are saturated
  // Moments of a row of four pixels are summed in registers; those of a tile's 64 rows in local
  // memory, BATCH_BWD splats between two barriers, in a fixed order.
  local float row_moments[BATCH_BWD][TILE_ROWS * ROW_STRIDE];
  local uchar gradient_cells[16];
  local int row_ends[TILE_ROWS], has_flow_gradient;
  const int l = get_local_id(0), cell = l >> 2;
  const int x = x0 + (cell & 3) * CELL, y = y0 + (cell >> 2) * CELL + (l & 3);
  PixelGrads state[CELL];
  if (shared) {
    if (l == 0) has_flow_gradient = 0;
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int i = 0; i < CELL; ++i) {
      const size_t at = (size_t)y * width + x + i;
      if (x + i >= width || y >= height) continue;
      if (v_flow[at] != 0.f || v_flow[at + (size_t)width * height] != 0.f) has_flow_gradient = 1;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    if (has_flow_gradient != FLOW) return;
  }
  if (l < 16) gradient_cells[l] = !ASKING;
  barrier(CLK_LOCAL_MEM_FENCE);
  int row_end = 0;
  for (int i = 0; i < CELL; ++i) {
    const int inside = x + i < width && y < height;
    state[i] = inside
                   ? grads_start((size_t)y * width + x + i, width, height, background, alpha, flow,
                                 flow_weight, transmittance, ends, v_rgb, v_alpha, v_depth, v_flow)
                   : grads_none();
    if (ASKING && has_gradient(state[i])) gradient_cells[cell] = 1;
    row_end = max(row_end, state[i].end);
  }
  row_ends[l] = row_end;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int c = 0; c < 16; ++c) with_gradient |= (uint)gradient_cells[c] << c;
  for (int row = 0; row < TILE_ROWS; ++row)
    if (with_gradient >> (row >> 2) & 1) stop = max(stop, row_ends[row]);
  if (!with_gradient) stop = 0;
  for (size_t i = (size_t)(first + stop) * MOMENTS + l; i < (size_t)end * MOMENTS; i += TILE_ROWS)
    partials[(size_t)isect_slots[i / MOMENTS] * MOMENTS + i % MOMENTS] = 0.f;
  for (uint start = first + stop; start > first;) {
    const uint count = min((uint)BATCH_BWD, start - first);
    start -= count;
    for (uint b = count; b-- > 0;) {
      if (!((masks[start + b] & with_gradient) >> cell & 1)) continue;
      const Splat s = splat_load(splats, isect_ids[start + b]);
      Moments m = moments_zero();
      for (int i = 0; i < CELL; ++i) {
        const float dx = (float)(x + i) + 0.5f - s.a.x, dy = (float)y + 0.5f - s.a.y;
        m = pixel_unblend(&state[i], m, s, footprint(s, dx, dy), (int)(start + b - first) + 1);
      }
      local float* o = row_moments[b] + l * ROW_STRIDE;
      o[0] = m.q, o[1] = m.qz1, o[2] = m.qz2, o[3] = m.qz11, o[4] = m.qz12, o[5] = m.qz22;
      o[6] = m.wr, o[7] = m.wg, o[8] = m.wb, o[9] = m.wd, o[10] = m.fx, o[11] = m.fy;
      o[12] = m.fx1, o[13] = m.fx2, o[14] = m.fy1, o[15] = m.fy2;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (uint sum_of = l; sum_of < count * MOMENTS; sum_of += TILE_ROWS) {
      const uint b = sum_of / MOMENTS, k = start + b;
      local const float* in = row_moments[b] + sum_of % MOMENTS;
      float sum = 0.f;
      for (int c = 0; c < 16; ++c)
        if ((masks[k] & with_gradient) >> c & 1)
          for (int row = 0; row < CELL; ++row) sum += in[(c * CELL + row) * ROW_STRIDE];
      partials[(size_t)isect_slots[k] * MOMENTS + sum_of % MOMENTS] = sum;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
  }
}
