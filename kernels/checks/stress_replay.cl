// SPDX-License-Identifier: Apache-2.0
// Replays the lists of a drawn image for `gflow stress`, front to back as in splat.cl and back to
// front as in splat_bwd. Forward stores each pixel's transmittance, the entry until which it was
// open, and how many splats contributed. Backward starts from the first two and stores the
// transmittance in front of all splats and its own count. LANES > 1: one work-item per tile; LANES
// == 1: a group of 256 per tile, one work-item per pixel.
#define FLOW 0
#define DEPTH 0
#include "shared/pixel.h"

#define REPLAY_ARGUMENTS                                                                       \
  const int width, const int height, global const float *restrict splats,                      \
      global const uint *restrict tile_offsets, global const uint *restrict isect_ids,          \
      global const ushort *restrict masks, global float *restrict T, global int *restrict ends, \
      global float *restrict counts

typedef struct Step {
  lane T, n;
  lane_int end;
} Step;

static inline Step step_fwd(Step o, Splat s, Footprint at, int entry) {
  PixelSums p = pixel_start();
  p.T = o.T;
  p.end = o.end;
  p = pixel_blend(p, s, at, entry);
  o.T = p.T;
  o.end = p.end;
  o.n += LANE_SELECT(TO_LANE(0.f), TO_LANE(1.f), p.W > TO_LANE(0.f));
  return o;
}
static inline Step step_bwd(Step o, Splat s, Footprint at, int entry) {
  PixelGrads p;
  p.T = o.T;
  p.end = o.end;
  p.R = p.vg = p.vb = TO_LANE(0.f);
  p.vr = TO_LANE(1.f);
  const Moments m = pixel_unblend(&p, moments_zero(), s, at, entry);
  o.T = p.T;
  o.n += LANE_SELECT(TO_LANE(0.f), TO_LANE(1.f), m.wr > TO_LANE(0.f));
  return o;
}

// Position and state of a pixel or lane vector. BACK starts from what was stored.
#if LANES == 1
#define READ(plane) plane[(size_t)y * width + x]
#define READ_INT(plane) plane[(size_t)y * width + x]
#define WRITE(value, plane) plane[(size_t)y * width + x] = value
#define WRITE_INT(value, plane) plane[(size_t)y * width + x] = value
#else
#define READ(plane) lane_load(plane, x, y, width, height)
#define READ_INT(plane) lane_load_int(plane, x, y, width, height)
#define WRITE(value, plane) lane_store(value, plane, x, y, width, height)
#define WRITE_INT(value, plane) lane_store_int(value, plane, x, y, width, height)
#endif
#define START(BACK)                                       \
  {                                                       \
    BACK ? READ(T) : TO_LANE(1.f), TO_LANE(0.f),          \
        BACK ? READ_INT(ends) : (lane_int)(0)             \
  }
#define LEAVE(o)                    \
  WRITE(fabs((o).T), T);            \
  WRITE_INT((o).end, ends);         \
  WRITE((o).n, counts)
#define ENTRY(BACK, j) (BACK ? count - (j) : (j) + 1)

#if LANES == 1
#define WALK(STEP, BACK)                                                                      \
  const int tiles_x = (width + TILE - 1) / TILE, tile = get_group_id(0), l = get_local_id(0); \
  const int cell = l >> 4, x = tile % tiles_x * TILE + (cell & 3) * CELL + (l & 3);           \
  const int y = tile / tiles_x * TILE + (cell >> 2) * CELL + ((l >> 2) & 3);                  \
  if (x >= width || y >= height) return;                                                      \
  const uint first = tile_offsets[tile];                                                      \
  const int count = (int)(tile_offsets[tile + 1] - first);                                    \
  Step o = START(BACK);                                                                       \
  for (int j = 0; j < count; ++j) {                                                           \
    const int entry = ENTRY(BACK, j);                                                         \
    const uint k = first + entry - 1;                                                         \
    if (!(masks[k] >> cell & 1)) continue;                                                    \
    const Splat s = splat_load(splats, isect_ids[k]);                                         \
    const Footprint at = footprint(s, (float)x + 0.5f - s.a.x, (float)y + 0.5f - s.a.y);      \
    o = STEP(o, s, at, entry);                                                                \
  }                                                                                           \
  LEAVE(o);
#else
#define WALK(STEP, BACK)                                                                      \
  const int tiles_x = (width + TILE - 1) / TILE, tile = get_group_id(0);                      \
  const int x0 = tile % tiles_x * TILE, y0 = tile / tiles_x * TILE;                           \
  const uint first = tile_offsets[tile];                                                      \
  const int count = (int)(tile_offsets[tile + 1] - first);                                    \
  Step o[TILE_PARTS];                                                                         \
  FOR_PARTS {                                                                                 \
    const Step start = START(BACK);                                                           \
    o[i] = start;                                                                             \
  }                                                                                           \
  for (int j = 0; j < count; ++j) {                                                           \
    const int entry = ENTRY(BACK, j);                                                         \
    const uint k = first + entry - 1;                                                         \
    uint mask = masks[k];                                                                     \
    if (!mask) continue;                                                                      \
    const Splat s = splat_load(splats, isect_ids[k]);                                         \
    const TileFrame f = tile_frame(s, x0, y0);                                                \
    while (mask) {                                                                            \
      const int cell = next_cell(&mask);                                                      \
      const CellFootprint at = cell_footprint(s, &f, cell);                                   \
      for (int part = 0; part < CELL_PARTS; ++part) {                                         \
        const int i = cell * CELL_PARTS + part;                                               \
        o[i] = STEP(o[i], s, at.part[part], entry);                                           \
      }                                                                                       \
    }                                                                                         \
  }                                                                                           \
  FOR_PARTS { LEAVE(o[i]); }
#define FOR_PARTS                                                                    \
  for (int i = 0, x, y; i < TILE_PARTS &&                                            \
                        (x = x0 + (i / CELL_PARTS & 3) * CELL,                       \
                        y = y0 + (i / CELL_PARTS >> 2) * CELL + i % CELL_PARTS * LANE_ROWS, 1); \
       ++i)
#endif

kernel void replay_fwd(REPLAY_ARGUMENTS) { WALK(step_fwd, 0) }
kernel void replay_bwd(REPLAY_ARGUMENTS) { WALK(step_bwd, 1) }
