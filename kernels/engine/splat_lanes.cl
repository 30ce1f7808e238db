// SPDX-License-Identifier: Apache-2.0
// splat.cl for CPUs: one work-item (group of 1) per tile, whose pixels are vectors of LANES floats;
// splats outer, touched cells inner. Fastest on PoCL: prefetching splats, and computing the next
// footprint before blending the last.
#include "shared/pixel_grads.h"

static inline void cell_blend(PixelSums* sums, Splat s, CellFootprint at, int entry) {
#pragma unroll
  for (int part = 0; part < CELL_PARTS; ++part)
    sums[part] = pixel_blend(sums[part], s, at.part[part], entry);
}

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
  const uint first = tile_offsets[tile], end = tile_offsets[tile + 1];
  if (shared && with_flow[tile] != FLOW) return;
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
                   lane_sum(m.wb), lane_sum(m.wd), lane_sum(m.fx), lane_sum(m.fy), lane_sum(m.fx1),
                   lane_sum(m.fx2), lane_sum(m.fy1), lane_sum(m.fy2));
#endif
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
    state[i] = grads_start(x, y, width, height, background, alpha, flow, flow_weight, transmittance,
                           ends, v_rgb, v_alpha, v_depth, v_flow);
    if (ASKING && !lane_any(has_gradient(state[i]))) continue;
    with_gradient |= 1u << cell;
    full = max(full, state[i].end);
  }
  if (SATURATED) stop = lane_max_int(full);
  if (!with_gradient) stop = 0;
  uint k = first + stop;
  for (uint out = k; out < end; ++out) vstore16((float16)(0.f), isect_slots[out], partials);
  while (k > first) {
    --k;
    const uint soon = max(k, first + 8) - 8;
    READ_SOON(splats + 16 * (size_t)isect_ids[soon]);
    WRITE_SOON(partials + MOMENTS * (size_t)isect_slots[soon]);
    Moments m = moments_zero();
    uint mask = masks[k] & with_gradient;
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
    vstore16(moments_sums(m), isect_slots[k], partials);
  }
}
