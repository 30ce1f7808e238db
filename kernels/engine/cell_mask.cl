// SPDX-License-Identifier: Apache-2.0
// Which of a tile's 16 cells of 4x4 pixels each splat touches, one bit per cell. The minimum of |K
// d|^2 over a rectangle is at the splat's centre if inside, else on the edge nearest in x or in y.
// Both candidates are evaluated as |K d|^2, which stays accurate for long, thin splats. The mask is
// a superset of what the pixel test keeps (margin 1e-3 in the exponent), so it does not change a
// bit of the image. Masks halve the time of image and gradients, and are faster than a range of
// cells per splat.
// One work-group per tile: a single work-item on CPUs, TILE_GROUP of them on GPUs. CELL_MASKS 0:
// all cells (Skips::masks).
#include "shared/lane.h"

#ifndef CELL_MASKS
#define CELL_MASKS 1
#endif

#if LANES == 1
static inline uint touched_cells(float4 a, float4 b, float x0, float y0) {
  uint mask = 0;
  const float ky = -a.z * a.w / (a.w * a.w + b.x * b.x), kx = -a.w / a.z;
  for (int c = 0; c < 16; ++c) {
    const float lx = x0 + (c & 3) * CELL + 0.5f - a.x, ly = y0 + (c >> 2) * CELL + 0.5f - a.y;
    const float hx = lx + 3.f, hy = ly + 3.f;
    const float ex = fmin(fmax(0.f, lx), hx), ey = fmin(fmax(0.f, ly), hy);
    const float y1 = fmin(fmax(ex * ky, ly), hy), x2 = fmin(fmax(ey * kx, lx), hx);
    const float p1 = a.z * ex + a.w * y1, p2 = b.x * y1, q1 = a.z * x2 + a.w * ey, q2 = b.x * ey;
    const float least = fmin(p1 * p1 + p2 * p2, q1 * q1 + q2 * q2);
    mask |= b.y - least >= ALPHA_MIN_LOG2 - 1e-3f ? 1u << c : 0u;
  }
  return mask;
}
#else
// Left and top edges of LANES cells, and their mask bits.
#if LANES == 16
#define CELL_X ((lane)(0, 4, 8, 12, 0, 4, 8, 12, 0, 4, 8, 12, 0, 4, 8, 12))
#define CELL_Y ((lane)(0, 0, 0, 0, 4, 4, 4, 4, 8, 8, 8, 8, 12, 12, 12, 12))
#define CELL_BIT \
  ((lane_int)(1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096, 8192, 16384, 32768))
#elif LANES == 8
#define CELL_X ((lane)(0, 4, 8, 12, 0, 4, 8, 12))
#define CELL_Y ((lane)(0, 0, 0, 0, 4, 4, 4, 4))
#define CELL_BIT ((lane_int)(1, 2, 4, 8, 16, 32, 64, 128))
#else
#define CELL_X ((lane)(0, 4, 8, 12))
#define CELL_Y ((lane)(0))
#define CELL_BIT ((lane_int)(1, 2, 4, 8))
#endif

// Faster on PoCL than fmin and fmax, which also handle NaN.
static inline lane lane_min(lane a, lane b) { return LANE_SELECT(b, a, a < b); }
static inline lane lane_max(lane a, lane b) { return LANE_SELECT(b, a, a > b); }

static inline uint touched_cells(float4 a, float4 b, float x0, float y0) {
  uint mask = 0;
  const lane k1 = TO_LANE(a.z), k2 = TO_LANE(a.w), k3 = TO_LANE(b.x), zero = TO_LANE(0.f);
  const lane ky = TO_LANE(-a.z * a.w / (a.w * a.w + b.x * b.x)), kx = TO_LANE(-a.w / a.z);
  const lane lx = CELL_X + TO_LANE(x0 + 0.5f - a.x), hx = lx + TO_LANE(3.f);
  const lane ex = lane_min(lane_max(zero, lx), hx);
  for (int g = 0; g < 16 / LANES; ++g) {
    const lane ly = CELL_Y + TO_LANE(y0 + 0.5f - a.y + (float)(g * LANES)), hy = ly + TO_LANE(3.f);
    const lane ey = lane_min(lane_max(zero, ly), hy);
    const lane y1 = lane_min(lane_max(ex * ky, ly), hy), x2 = lane_min(lane_max(ey * kx, lx), hx);
    const lane p1 = fma(k1, ex, k2 * y1), p2 = k3 * y1, q1 = fma(k1, x2, k2 * ey), q2 = k3 * ey;
    const lane least = lane_min(fma(p1, p1, p2 * p2), fma(q1, q1, q2 * q2));
    const lane_int in = TO_LANE(b.y) - least >= TO_LANE(ALPHA_MIN_LOG2 - 1e-3f);
    mask |= (uint)lane_any(in & CELL_BIT) << (g * LANES);
  }
  return mask;
}
#endif

kernel void cell_mask(const uint tiles_x, global const float* restrict splats,  // [N, 16]
                      global const uint* restrict tile_offsets,                 // [tiles + 1]
                      global const uint* restrict isect_ids,                    // [M]
                      global ushort* restrict masks) {                          // [M]
  const uint tile = get_group_id(0);
  const float x0 = (float)(tile % tiles_x * TILE), y0 = (float)(tile / tiles_x * TILE);
  const uint end = tile_offsets[tile + 1];
  for (uint k = tile_offsets[tile] + get_local_id(0); k < end; k += get_local_size(0)) {
    const uint i = isect_ids[k];
    READ_SOON(splats + 16 * (size_t)isect_ids[min(k + 16, end - 1)]);
    const float4 low = vload4(4 * i, splats), high = vload4(4 * i + 1, splats);
    masks[k] = CELL_MASKS ? (ushort)touched_cells(low, high, x0, y0) : 0xffff;
  }
}
