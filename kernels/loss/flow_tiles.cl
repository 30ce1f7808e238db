// SPDX-License-Identifier: Apache-2.0
// Samples the tiles in which a step evaluates the flow loss. Tiles where the target moves fast
// always count; low-motion tiles count with a lower probability and a higher weight (flow_share);
// tiles without confident pixels never count. The expected gradient is that of all tiles.
// All tiles of an image use the same random draw, so that its low-motion tiles are sampled
// together: a Gaussian that touches one of them costs as much at t2 as one that touches all.
// One work-item per tile.
#include "shared/lane_row.h"
#include "shared/loss.h"

kernel void flow_tiles(const uint width, const uint height, const float low_motion,
                       const float low_motion_px,
                       const float draw,                          // uniform in (0, 1)
                       global const float* restrict target_flow,  // [2, H, W] target flow [px]
                       global const uchar* restrict confidence,   // [H, W] 255 = full
                       global float* restrict tile_weights) {     // [tiles] 0: not sampled
  const uint tiles_x = (width + TILE - 1) / TILE, tiles_y = (height + TILE - 1) / TILE;
  const uint tile = get_global_id(0), pixels = width * height;
  if (tile >= tiles_x * tiles_y) return;
  const uint left = tile % tiles_x * TILE, top = tile / tiles_x * TILE;
  const uint right = min(left + TILE, width), bottom = min(top + TILE, height);
  union {
    lane all;
    float one[LANES];
  } most;  // largest |motion|^2 confidence^2; below 0: no confident pixel
  most.all = TO_LANE(-1.0f);
  for (uint row = top; row < bottom; ++row)
    for (uint column = left; column < right; column += LANES) {
      const uint i = row * width + column;
      const int count = right - column;
      const lane x = row_load(target_flow + i, count),
                 y = row_load(target_flow + pixels + i, count);
      const lane trust = row_load_bytes(confidence + i, count) * (1.0f / 255.0f);
      const lane_int counts = (trust > TO_LANE(0.0f)) & (fabs(x) <= TO_LANE(TARGET_FLOW_LIMIT)) &
                              (fabs(y) <= TO_LANE(TARGET_FLOW_LIMIT));  // NaN fails
      const lane square = trust * trust * (x * x + y * y);
      most.all = fmax(most.all, LANE_SELECT(TO_LANE(-1.0f), square, counts));
    }
  float square = most.one[0];
  for (int k = 1; k < LANES; ++k) square = fmax(square, most.one[k]);
  const float share = square < 0.0f ? 0.0f : flow_share(sqrt(square), low_motion, low_motion_px);
  tile_weights[tile] = draw <= share ? 1.0f / share : 0.0f;
}
