// SPDX-License-Identifier: Apache-2.0
// The flow loss: scale * sum over pixels of tile weight * confidence * alpha * rho(flow - target),
// rho being the robust norm of shared/loss.h. alpha is treated as a constant: where nothing is
// drawn, no motion is required.
// Loss and gradient are exactly 0, whatever the other values, where the tile weight, the confidence
// or alpha is 0 or the target is non-finite or above 1e5 px.
// One work-item per LANES neighbouring pixels of a row, all in one tile: faster than one work-item
// per pixel, which PoCL does not vectorise. Bitwise repeatable, since nothing is summed here.
#include "shared/lane_row.h"
#include "shared/loss.h"

kernel void flow_loss(const uint width, const uint height, const float scale, const float knee,
                      const int sampled,                          // 0: every tile weighs 1
                      global const float* restrict tile_weights,  // [tiles] flow_tiles.cl
                      global const float* restrict flow,          // [2, H, W] px
                      global const float* restrict alpha,         // [H, W]
                      global const float* restrict target_flow,   // [2, H, W] target flow [px]
                      global const uchar* restrict confidence,    // [H, W] 255 = full
                      global float* restrict v_flow,              // [2, H, W]
                      // [3, H, W] loss; tile weight times end-point error; tile weight
                      global float* restrict terms) {
  const uint runs = (width + LANES - 1) / LANES, pixels = width * height;
  const uint x0 = get_global_id(0) % runs * LANES, y0 = get_global_id(0) / runs;
  if (y0 >= height) return;
  const uint i = y0 * width + x0;
  const int count = width - x0;
  const uint tile = y0 / TILE * ((width + TILE - 1) / TILE) + x0 / TILE;
  const float asked = sampled ? tile_weights[tile] : 1.0f;
  const lane zero = TO_LANE(0.0f);
  const lane target_x = row_load(target_flow + i, count);
  const lane target_y = row_load(target_flow + pixels + i, count);
  const lane x = row_load(flow + i, count) - target_x;
  const lane y = row_load(flow + pixels + i, count) - target_y;
  const lane trust = row_load_bytes(confidence + i, count) * (1.0f / 255.0f);
  const lane weight = asked * scale * trust * row_load(alpha + i, count);
  const lane_int counted = (asked * trust > zero) & (fabs(target_x) <= TO_LANE(TARGET_FLOW_LIMIT)) &
                           (fabs(target_y) <= TO_LANE(TARGET_FLOW_LIMIT));  // NaN fails
  const lane_int weighted = counted & (weight > zero);

  const RobustNormGradient v = robust_norm_vjp(x, y, knee, weight);
  row_store(LANE_SELECT(zero, v.x, weighted), v_flow + i, count);
  row_store(LANE_SELECT(zero, v.y, weighted), v_flow + pixels + i, count);
  const lane loss = weight * robust_norm(x, y, knee);
  row_store(LANE_SELECT(zero, loss, weighted), terms + i, count);
  const lane error = asked * robust_norm(x, y, 1e-20f);
  row_store(LANE_SELECT(zero, error, counted), terms + pixels + i, count);
  row_store(LANE_SELECT(zero, TO_LANE(asked), counted), terms + 2 * pixels + i, count);
}
