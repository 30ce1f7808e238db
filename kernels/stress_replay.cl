// SPDX-License-Identifier: Apache-2.0
// The lists of a drawn image walked as splat.cl and as splat_bwd.cl walk them, for `gflow stress`:
// each leaves what passes through a pixel and how many splats counted there. Both must have the
// same bits. LANES > 1: one work-item a tile; LANES == 1: a group of 256 a tile, one work-item a
// pixel.
#define FLOW 0
#define DEPTH 0
#include "shared/pixel.h"

#define REPLAY_ARGUMENTS                                                                   \
  const int width, const int height, global const float *restrict splats,                 \
      global const uint *restrict tile_offsets, global const uint *restrict isect_ids,     \
      global const ushort *restrict masks, global float *restrict T, global float *restrict counts

// One step of a pixel, forward and backward: the state's T goes on, n counts.
static inline lane step_fwd(lane* T, Splat s, Footprint at) {
  PixelSums p = pixel_start();
  p.T = *T;
  p = pixel_blend(p, s, at);
  *T = p.T;
  return LANE_SELECT(TO_LANE(0.f), TO_LANE(1.f), p.W > TO_LANE(0.f));
}
static inline lane step_bwd(lane* T, Splat s, Footprint at) {
  PixelGrads p;
  p.T = *T;
  p.R = p.vg = p.vb = TO_LANE(0.f);
  p.vr = TO_LANE(1.f);
  const Moments m = pixel_unblend(&p, moments_zero(), s, at);
  *T = p.T;
  return LANE_SELECT(TO_LANE(0.f), TO_LANE(1.f), m.wr > TO_LANE(0.f));
}

#if LANES == 1
#define WALK(STEP)                                                                         \
  const int tiles_x = (width + TILE - 1) / TILE, tile = get_group_id(0), l = get_local_id(0); \
  const int cell = l >> 4, x = tile % tiles_x * TILE + (cell & 3) * CELL + (l & 3);        \
  const int y = tile / tiles_x * TILE + (cell >> 2) * CELL + ((l >> 2) & 3);               \
  if (x >= width || y >= height) return;                                                   \
  float t = 1.f, n = 0.f;                                                                  \
  for (uint k = tile_offsets[tile]; k < tile_offsets[tile + 1]; ++k) {                     \
    if (!(masks[k] >> cell & 1)) continue;                                                 \
    const Splat s = splat_load(splats, isect_ids[k]);                                      \
    n += STEP(&t, s, footprint(s, (float)x + 0.5f - s.a.x, (float)y + 0.5f - s.a.y));       \
  }                                                                                        \
  T[(size_t)y * width + x] = fabs(t);                                                      \
  counts[(size_t)y * width + x] = n;
#else
#define WALK(STEP)                                                                         \
  const int tiles_x = (width + TILE - 1) / TILE, tile = get_group_id(0);                   \
  const int x0 = tile % tiles_x * TILE, y0 = tile / tiles_x * TILE;                        \
  lane t[TILE_PARTS], n[TILE_PARTS];                                                       \
  for (int i = 0; i < TILE_PARTS; ++i) {                                                   \
    t[i] = TO_LANE(1.f);                                                                   \
    n[i] = TO_LANE(0.f);                                                                   \
  }                                                                                        \
  for (uint k = tile_offsets[tile]; k < tile_offsets[tile + 1]; ++k) {                     \
    uint mask = masks[k];                                                                  \
    if (!mask) continue;                                                                   \
    const Splat s = splat_load(splats, isect_ids[k]);                                      \
    const TileFrame f = tile_frame(s, x0, y0);                                             \
    while (mask) {                                                                         \
      const int cell = next_cell(&mask);                                                   \
      const CellFootprint at = cell_footprint(s, &f, cell);                                \
      for (int part = 0; part < CELL_PARTS; ++part)                                        \
        n[cell * CELL_PARTS + part] += STEP(t + cell * CELL_PARTS + part, s, at.part[part]); \
    }                                                                                      \
  }                                                                                        \
  for (int i = 0; i < TILE_PARTS; ++i) {                                                   \
    const int cell = i / CELL_PARTS, x = x0 + (cell & 3) * CELL;                           \
    const int y = y0 + (cell >> 2) * CELL + i % CELL_PARTS * LANE_ROWS;                    \
    lane_store(fabs(t[i]), T, x, y, width, height);                                        \
    lane_store(n[i], counts, x, y, width, height);                                         \
  }
#endif

kernel void replay_fwd(REPLAY_ARGUMENTS) { WALK(step_fwd) }
kernel void replay_bwd(REPLAY_ARGUMENTS) { WALK(step_bwd) }
