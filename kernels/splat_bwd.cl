// SPDX-License-Identifier: Apache-2.0
// The image's gradient: each tile processes its list back to front, from where the last of its
// pixels was saturated, and each intersection stores the 16 sums of shared/pixel.h in its own slot;
// `gather` adds a Gaussian's slots in order. No atomics: bitwise repeatable. Fastest on PoCL:
// prefetching, as in splat.cl.
// With `shared` the program with FLOW takes the tiles whose v_flow is not 0, the one without the
// others (Skips::flow, View::flow_tiles). ASKING 1: skips cells of pixels whose incoming gradients
// are all 0 (Skips::asking).
#include "shared/pixel.h"

#ifndef ASKING
#define ASKING 1
#endif
#ifndef MOMENT_BITS
#define MOMENT_BITS 32
#endif

// LANES == 1: splats between two barriers; rows of four pixels in a tile, one per work-item; floats
// per row in local memory, with one more so that rows use different banks.
#define BATCH_BWD 4
#define TILE_ROWS 64
#define ROW_STRIDE (MOMENTS + 1)

// The gradient state behind all splats of the pixels at `at` / lane vector (x, y), from what the
// forward pass stored and the images' gradients. That of alpha is applied to 1 - transmittance.
#if LANES == 1
#define LOAD(plane) plane[at]
#define LOAD_INT(plane) plane[at]
#else
#define LOAD(plane) lane_load(plane, x, y, width, height)
#define LOAD_INT(plane) lane_load_int(plane, x, y, width, height)
#endif

static inline PixelGrads grads_start(
#if LANES == 1
    size_t at,
#else
    int x, int y,
#endif
    int width, int height, float3 background, global const float* alpha, global const float* flow,
    global const float* flow_weight, global const float* transmittance, global const int* ends,
    global const float* v_rgb, global const float* v_alpha, global const float* v_depth,
    global const float* v_flow) {
  const size_t pixels = (size_t)width * height;
  PixelGrads p;
  p.T = LOAD(transmittance);
  p.end = LOAD_INT(ends);
  p.vr = LOAD(v_rgb);
  p.vg = LOAD((v_rgb + pixels));
  p.vb = LOAD((v_rgb + 2 * pixels));
  p.R = fma(p.vr, TO_LANE(background.x),
            fma(p.vg, TO_LANE(background.y), p.vb * TO_LANE(background.z)));
  p.R = (p.R - LOAD(v_alpha)) * p.T;
#if DEPTH
  p.vd = LOAD(v_depth);
#endif
#if FLOW
#if TOP_K
  const lane W_flow = LOAD(flow_weight);
  p.flow_end = LOAD_INT((ends + pixels));
#else
  const lane W_flow = LOAD(alpha);
#endif
  const lane zero = TO_LANE(0.f);
  p.vfx = LANE_SELECT(zero, LOAD(v_flow) / W_flow, W_flow > zero);
  p.vfy = LANE_SELECT(zero, LOAD((v_flow + pixels)) / W_flow, W_flow > zero);
  // flow = sum w f / W
  p.v0 = -fma(p.vfx, LOAD(flow), p.vfy * LOAD((flow + pixels)));
#endif
  return p;
}

#if LANES == 1
// A pixel outside the image.
static inline PixelGrads grads_none(void) {
  PixelGrads p = {0};
  return p;
}
#endif

// Whether a pixel's gradients can be other than 0. With v_alpha alone, R is not 0.
static inline lane_int asks(PixelGrads p) {
  const lane zero = TO_LANE(0.f);
  lane_int any = (p.vr != zero) | (p.vg != zero) | (p.vb != zero) | (p.R != zero);
#if DEPTH
  any |= p.vd != zero;
#endif
#if FLOW
  any |= (p.vfx != zero) | (p.vfy != zero);
#endif
  return any;
}

#if LANES == 16
// 16 lane vectors to their 16 sums by halving: 15 additions and one 64-byte store.
#define PAIR(a, b) ((lane)((a).even, (b).even) + (lane)((a).odd, (b).odd))
static inline lane sums_of(Moments m) {
  const lane b0 = PAIR(m.q, m.qz1), b1 = PAIR(m.qz2, m.qz11), b2 = PAIR(m.qz12, m.qz22);
  const lane b3 = PAIR(m.wr, m.wg), b4 = PAIR(m.wb, m.wd), b5 = PAIR(m.fx, m.fy);
  const lane b6 = PAIR(m.fx1, m.fx2), b7 = PAIR(m.fy1, m.fy2);
  const lane c0 = PAIR(b0, b1), c1 = PAIR(b2, b3), c2 = PAIR(b4, b5), c3 = PAIR(b6, b7);
  return PAIR(PAIR(c0, c1), PAIR(c2, c3));
}
#elif LANES == 8
#define PAIR(a, b) ((lane)((a).even, (b).even) + (lane)((a).odd, (b).odd))
static inline lane sums8(lane a0, lane a1, lane a2, lane a3, lane a4, lane a5, lane a6, lane a7) {
  const lane b0 = PAIR(a0, a1), b1 = PAIR(a2, a3), b2 = PAIR(a4, a5), b3 = PAIR(a6, a7);
  return PAIR(PAIR(b0, b1), PAIR(b2, b3));
}
#endif

#if LANES > 1
static inline Moments cell_unblend(PixelGrads* state, Moments m, Splat s, CellFootprint at,
                                   int entry) {
#pragma unroll
  for (int part = 0; part < CELL_PARTS; ++part)
    m = pixel_unblend(&state[part], m, s, at.part[part], entry);
  return m;
}

static inline float16 moments_sums(Moments m) {
#if LANES == 16
  return sums_of(m);
#elif LANES == 8
  return (float16)(sums8(m.q, m.qz1, m.qz2, m.qz11, m.qz12, m.qz22, m.wr, m.wg),
                   sums8(m.wb, m.wd, m.fx, m.fy, m.fx1, m.fx2, m.fy1, m.fy2));
#elif LANES == 4
  return (float16)(lane_sum(m.q), lane_sum(m.qz1), lane_sum(m.qz2), lane_sum(m.qz11),
                   lane_sum(m.qz12), lane_sum(m.qz22), lane_sum(m.wr), lane_sum(m.wg),
                   lane_sum(m.wb), lane_sum(m.wd), lane_sum(m.fx), lane_sum(m.fy),
                   lane_sum(m.fx1), lane_sum(m.fx2), lane_sum(m.fy1), lane_sum(m.fy2));
#endif
}
#endif

// Slots are stored as floats, or as their upper halves for `gflow bench pareto` (MOMENT_BITS 16).
#if MOMENT_BITS == 16
#define KEPT(x, width) convert_ushort##width((as_uint##width(x) + 0x8000u) >> 16)
#define KEPT_IN(partials) ((global ushort*)(partials))
#else
#define KEPT(x, width) (x)
#define KEPT_IN(partials) (partials)
#endif
static inline float8 slot_half(size_t half_slot, global const float* partials) {
#if MOMENT_BITS == 16
  return as_float8(convert_uint8(vload8(half_slot, (global const ushort*)partials)) << 16);
#else
  return vload8(half_slot, partials);
#endif
}

kernel void splat_bwd(const int width, const int height, const int shared,
                      global const float* restrict splats,
                      global const uint* restrict tile_offsets,
                      global const uint* restrict isect_ids,
                      global const uint* restrict isect_slots,  // [M]
                      global const ushort* restrict masks, const float background_r,
                      const float background_g, const float background_b,
                      global const float* restrict alpha, global const float* restrict flow,
                      global const float* restrict flow_weight,
                      global const float* restrict transmittance,
                      global const int* restrict ends,
                      global const float* restrict v_rgb, global const float* restrict v_alpha,
                      global const float* restrict v_depth, global const float* restrict v_flow,
                      global float* restrict partials) {  // [M, 16]
  const int tiles_x = (width + TILE - 1) / TILE;
  const int tile = get_group_id(0);
  const int x0 = tile % tiles_x * TILE, y0 = tile / tiles_x * TILE;
  const uint first = tile_offsets[tile], end = tile_offsets[tile + 1];
  const float3 background = (float3)(background_r, background_g, background_b);
  uint asking = 0;                            // cells with gradients, one bit each
  int stop = SATURATED ? 0 : (int)(end - first);  // entries until all pixels are saturated
#if LANES == 1
  // Moments of a row of four pixels are summed in registers; those of a tile's 64 rows in local
  // memory, BATCH_BWD splats between two barriers, in a fixed order.
  local float row_moments[BATCH_BWD][TILE_ROWS * ROW_STRIDE];
  local uchar asking_cells[16];
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
  if (l < 16) asking_cells[l] = !ASKING;
  barrier(CLK_LOCAL_MEM_FENCE);
  int row_end = 0;
  for (int i = 0; i < CELL; ++i) {
    const int inside = x + i < width && y < height;
    state[i] = inside ? grads_start((size_t)y * width + x + i, width, height, background, alpha,
                                    flow, flow_weight, transmittance, ends, v_rgb, v_alpha,
                                    v_depth, v_flow)
                      : grads_none();
    if (ASKING && asks(state[i])) asking_cells[cell] = 1;
    row_end = max(row_end, state[i].end);
  }
  row_ends[l] = row_end;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int c = 0; c < 16; ++c) asking |= (uint)asking_cells[c] << c;
  for (int row = 0; row < TILE_ROWS; ++row)
    if (asking >> (row >> 2) & 1) stop = max(stop, row_ends[row]);
  if (!asking) stop = 0;
  for (size_t i = (size_t)(first + stop) * MOMENTS + l; i < (size_t)end * MOMENTS; i += TILE_ROWS)
    KEPT_IN(partials)[(size_t)isect_slots[i / MOMENTS] * MOMENTS + i % MOMENTS] = KEPT(0.f, );
  for (uint start = first + stop; start > first;) {
    const uint count = min((uint)BATCH_BWD, start - first);
    start -= count;
    for (uint b = count; b-- > 0;) {
      if (!((masks[start + b] & asking) >> cell & 1)) continue;
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
        if ((masks[k] & asking) >> c & 1)
          for (int row = 0; row < CELL; ++row) sum += in[(c * CELL + row) * ROW_STRIDE];
      KEPT_IN(partials)[(size_t)isect_slots[k] * MOMENTS + sum_of % MOMENTS] = KEPT(sum, );
    }
    barrier(CLK_LOCAL_MEM_FENCE);
  }
#else
  if (shared) {
    lane_int any = 0;
    for (int i = 0; i < TILE_PARTS; ++i) {
      const int cell = i / CELL_PARTS, x = x0 + (cell & 3) * CELL;
      const int y = y0 + (cell >> 2) * CELL + i % CELL_PARTS * LANE_ROWS;
      any |= lane_load(v_flow, x, y, width, height) != TO_LANE(0.f);
      any |= lane_load(v_flow + (size_t)width * height, x, y, width, height) != TO_LANE(0.f);
    }
    if ((lane_any(any) != 0) != FLOW) return;
  }
  PixelGrads state[TILE_PARTS];
  lane_int full = (lane_int)(0);
  for (int i = 0; i < TILE_PARTS; ++i) {
    const int cell = i / CELL_PARTS, x = x0 + (cell & 3) * CELL;
    const int y = y0 + (cell >> 2) * CELL + i % CELL_PARTS * LANE_ROWS;
    state[i] = grads_start(x, y, width, height, background, alpha, flow, flow_weight,
                           transmittance, ends, v_rgb, v_alpha, v_depth, v_flow);
    if (ASKING && !lane_any(asks(state[i]))) continue;
    asking |= 1u << cell;
    full = max(full, state[i].end);
  }
  if (SATURATED) stop = lane_max_int(full);
  if (!asking) stop = 0;
  uint k = first + stop;
  for (uint out = k; out < end; ++out)
    vstore16(KEPT((float16)(0.f), 16), isect_slots[out], KEPT_IN(partials));
  while (k > first) {
    --k;
    const uint soon = max(k, first + 8) - 8;
    READ_SOON(splats + 16 * (size_t)isect_ids[soon]);
    WRITE_SOON(partials + MOMENTS * (size_t)isect_slots[soon]);
    Moments m = moments_zero();
    uint mask = masks[k] & asking;
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
        m = cell_unblend(state + i * CELL_PARTS, m, s, now, entry);
      }
      m = cell_unblend(state + cell * CELL_PARTS, m, s, at, entry);
    }
    vstore16(KEPT(moments_sums(m), 16), isect_slots[k], KEPT_IN(partials));
  }
#endif
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
    low += slot_half(2 * (size_t)slot, partials);
    high += slot_half(2 * (size_t)slot + 1, partials);
  }
  vstore8(low, 2 * (size_t)i, moments);
  vstore8(high, 2 * (size_t)i + 1, moments);
}
