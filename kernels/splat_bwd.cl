// SPDX-License-Identifier: Apache-2.0
// The image's derivative: each tile walks its list front to back again, and each intersection
// leaves the 16 sums of shared/pixel.h in its own slot; `gather` adds a Gaussian's slots in order.
// No atomics: bitwise repeatable. Needs only the output images, no last index and no list a pixel.
// Numbers: README, "Speed".
#include "shared/pixel.h"

// The gradient state of the pixels at `at` / lane vector (x, y), from images and their cotangents.
// alpha is 1 - transmittance: taken so, its share of R is exact where little passes through.
#if LANES == 1
#define LOAD(plane) plane[at]
#else
#define LOAD(plane) lane_load(plane, x, y, width, height)
#endif

static inline PixelGrads grads_start(
#if LANES == 1
    size_t at,
#else
    int x, int y,
#endif
    int width, int height, global const float* rgb, global const float* alpha,
    global const float* depth, global const float* flow, global const float* flow_weight,
    global const float* transmittance, global const float* v_rgb, global const float* v_alpha,
    global const float* v_depth, global const float* v_flow) {
  const size_t pixels = (size_t)width * height;
  PixelGrads p;
  p.T = TO_LANE(1.f);
  p.vr = LOAD(v_rgb);
  p.vg = LOAD((v_rgb + pixels));
  p.vb = LOAD((v_rgb + 2 * pixels));
  p.R = fma(p.vr, LOAD(rgb), fma(p.vg, LOAD((rgb + pixels)), p.vb * LOAD((rgb + 2 * pixels))));
  p.R = fma(-LOAD(v_alpha), LOAD(transmittance), p.R);
#if DEPTH
  p.vd = LOAD(v_depth);
  p.R = fma(p.vd, LOAD(depth), p.R);
#endif
#if FLOW
#if TOP_K
  const lane W_flow = LOAD(flow_weight);
#else
  const lane W_flow = LOAD(alpha);
#endif
  const lane zero = TO_LANE(0.f);
  p.vfx = LANE_SELECT(zero, LOAD(v_flow) / W_flow, W_flow > zero);
  p.vfy = LANE_SELECT(zero, LOAD((v_flow + pixels)) / W_flow, W_flow > zero);
  const lane back = fma(p.vfx, LOAD(flow), p.vfy * LOAD((flow + pixels)));
#if TOP_K
  p.n = zero;
#endif
  p.v0 = -back;  // flow = sum w f / W; its share of R is sum w (f - flow) . v = 0
#endif
  return p;
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
static inline Moments cell_unblend(PixelGrads* state, Moments m, Splat s, CellFootprint at) {
  for (int part = 0; part < CELL_PARTS; ++part)
    m = pixel_unblend(&state[part], m, s, at.part[part]);
  return m;
}

static inline void moments_store(Moments m, global float* out) {
#if LANES == 16
  vstore16(sums_of(m), 0, out);
#elif LANES == 8
  vstore8(sums8(m.q, m.qz1, m.qz2, m.qz11, m.qz12, m.qz22, m.wr, m.wg), 0, out);
  vstore8(sums8(m.wb, m.wd, m.fx, m.fy, m.fx1, m.fx2, m.fy1, m.fy2), 0, out + 8);
#elif LANES == 4
  vstore4((float4)(lane_sum(m.q), lane_sum(m.qz1), lane_sum(m.qz2), lane_sum(m.qz11)), 0, out);
  vstore4((float4)(lane_sum(m.qz12), lane_sum(m.qz22), lane_sum(m.wr), lane_sum(m.wg)), 1, out);
  vstore4((float4)(lane_sum(m.wb), lane_sum(m.wd), lane_sum(m.fx), lane_sum(m.fy)), 2, out);
  vstore4((float4)(lane_sum(m.fx1), lane_sum(m.fx2), lane_sum(m.fy1), lane_sum(m.fy2)), 3, out);
#endif
}
#endif

kernel void splat_bwd(const int width, const int height, global const float* restrict splats,
                      global const uint* restrict tile_offsets,
                      global const uint* restrict isect_ids,
                      global const uint* restrict isect_slots,  // [M]
                      global const ushort* restrict masks, global const float* restrict rgb,
                      global const float* restrict alpha, global const float* restrict depth,
                      global const float* restrict flow, global const float* restrict flow_weight,
                      global const float* restrict transmittance,
                      global const float* restrict v_rgb, global const float* restrict v_alpha,
                      global const float* restrict v_depth, global const float* restrict v_flow,
                      global float* restrict partials) {  // [M, 16]
  const int tiles_x = (width + TILE - 1) / TILE;
  const int tile = get_group_id(0);
  const int x0 = tile % tiles_x * TILE, y0 = tile / tiles_x * TILE;
  const uint first = tile_offsets[tile], end = tile_offsets[tile + 1];
#if LANES == 1
  // 256 pixels' moments -> 16 cells' -> the tile's, in a fixed order, two barriers a splat.
  local float pixel_moments[256 * (MOMENTS + 1)];
  local float cell_moments[16 * MOMENTS];
  const int l = get_local_id(0), cell = l >> 4;
  const int x = x0 + (cell & 3) * CELL + (l & 3), y = y0 + (cell >> 2) * CELL + ((l >> 2) & 3);
  const int inside = x < width && y < height;
  PixelGrads p;
  if (inside)
    p = grads_start((size_t)y * width + x, width, height, rgb, alpha, depth, flow, flow_weight,
                    transmittance, v_rgb, v_alpha, v_depth, v_flow);
  for (uint k = first; k < end; ++k) {
    const Splat s = splat_load(splats, isect_ids[k]);
    const int touched = masks[k] >> cell & 1;
    if (touched) {
      Moments m = moments_zero();
      const Footprint at = footprint(s, (float)x + 0.5f - s.a.x, (float)y + 0.5f - s.a.y);
      if (inside) m = pixel_unblend(&p, m, s, at);
      local float* o = pixel_moments + l * (MOMENTS + 1);
      o[0] = m.q, o[1] = m.qz1, o[2] = m.qz2, o[3] = m.qz11, o[4] = m.qz12, o[5] = m.qz22;
      o[6] = m.wr, o[7] = m.wg, o[8] = m.wb, o[9] = m.wd, o[10] = m.fx, o[11] = m.fy;
      o[12] = m.fx1, o[13] = m.fx2, o[14] = m.fy1, o[15] = m.fy2;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    float sum = 0.f;  // work-item l: moment l % 16 of its cell
    if (touched)
      for (int i = 0; i < 16; ++i) sum += pixel_moments[(cell * 16 + i) * (MOMENTS + 1) + (l & 15)];
    cell_moments[l] = sum;
    barrier(CLK_LOCAL_MEM_FENCE);
    if (l < MOMENTS) {
      float all = 0.f;
      for (int i = 0; i < 16; ++i) all += cell_moments[i * MOMENTS + l];
      partials[(size_t)isect_slots[k] * MOMENTS + l] = all;
    }
  }
#else
  PixelGrads state[TILE_PARTS];
  for (int i = 0; i < TILE_PARTS; ++i) {
    const int cell = i / CELL_PARTS, x = x0 + (cell & 3) * CELL;
    const int y = y0 + (cell >> 2) * CELL + i % CELL_PARTS * LANE_ROWS;
    state[i] = grads_start(x, y, width, height, rgb, alpha, depth, flow, flow_weight,
                           transmittance, v_rgb, v_alpha, v_depth, v_flow);
  }
  uint k = first;
  while (k < end) {
    const uint soon = min(k + 8, end - 1);
    READ_SOON(splats + 16 * (size_t)isect_ids[soon]);
    WRITE_SOON(partials + MOMENTS * (size_t)isect_slots[soon]);
    Moments m = moments_zero();
    uint mask = masks[k];
    if (mask) {
      const Splat s = splat_load(splats, isect_ids[k]);
      const TileFrame f = tile_frame(s, x0, y0);
      int cell = next_cell(&mask);
      CellFootprint at = cell_footprint(s, &f, cell);
      while (mask) {  // the next footprint fills the wait for this one's sums
        const CellFootprint now = at;
        const int i = cell;
        cell = next_cell(&mask);
        at = cell_footprint(s, &f, cell);
        m = cell_unblend(state + i * CELL_PARTS, m, s, now);
      }
      m = cell_unblend(state + cell * CELL_PARTS, m, s, at);
    }
    moments_store(m, partials + (size_t)isect_slots[k] * MOMENTS);
    ++k;
    if (SATURATED && ((k - first) & 31) == 0) {
      lane most = state[0].T;
      for (int i = 1; i < TILE_PARTS; ++i) most = fmax(most, state[i].T);
      if (!lane_any(still_open(most))) break;
    }
  }
  for (; k < end; ++k)
    for (uint part = 0; part < 2; ++part)
      vstore8((float8)(0.f), 2 * (size_t)isect_slots[k] + part, partials);
#endif
}

// One work-item a Gaussian: its slots summed in order. Unseen ones are left alone.
kernel void gather(const uint n, global const uint* restrict slot_offsets,  // [N + 1]
                   global const float* restrict partials,                   // [M, 16]
                   global float* restrict moments) {                        // [N, 16]
  const uint i = get_global_id(0);
  if (i >= n) return;
  const uint end = slot_offsets[i + 1];
  uint slot = slot_offsets[i];
  if (slot == end) return;  // unseen
  float8 low = (float8)(0.f), high = (float8)(0.f);
  for (; slot < end; ++slot) {
    low += vload8(2 * (size_t)slot, partials);
    high += vload8(2 * (size_t)slot + 1, partials);
  }
  vstore8(low, 2 * (size_t)i, moments);
  vstore8(high, 2 * (size_t)i + 1, moments);
}
