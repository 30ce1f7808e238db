// SPDX-License-Identifier: Apache-2.0
// The planes of the hexplane motion model: features of a Gaussian's place, their gradients to cells
// and means, and the regularisers. Vectors hold LANES channels.
#include "shared/arrays.h"
#include "shared/motion/hexplane.h"
#include "shared/lane_row.h"

#ifndef LEVELS  // only for the syntax check; the host always defines it
#define LEVELS 2
#define CHANNELS 16
#define HIDDEN 64
#define LAYERS 2
#define TURN 1
#define RESIZE 1
#define FEATURES 32
#endif
#define PARTS (CHANNELS / LANES)          // vectors per level
#define FEATURE_PARTS (FEATURES / LANES)  // of all levels

typedef struct Corner {  // a Gaussian's place on the planes of a level
  GridPlace at[3];
} Corner;
static inline Corner corner_of(real3 mean, HexplaneGrid grid, int level) {
  const int resolution = grid.resolution << level;
  Corner c;
  c.at[0] = grid_place(mean.x, grid.centre[0], grid.half_size[0], resolution);
  c.at[1] = grid_place(mean.y, grid.centre[1], grid.half_size[1], resolution);
  c.at[2] = grid_place(mean.z, grid.centre[2], grid.half_size[2], resolution);
  return c;
}

// The axes of plane 0 to 2: XY, XZ, YZ.
#define PLANE_U(plane) ((plane) == 2 ? 1 : 0)
#define PLANE_V(plane) ((plane) == 0 ? 1 : 2)

// Offset of a Gaussian's cell in the floats of the planes, and in those of the lines.
static inline size_t cell_at(HexplaneGrid grid, int level, int plane, Corner c, int part) {
  const uint r = (uint)grid.resolution << level;
  const uint start = hexplane_level_start(grid.resolution, grid.times, level);
  return (size_t)(start + (plane * r + c.at[PLANE_V(plane)].cell) * r + c.at[PLANE_U(plane)].cell) *
             CHANNELS +
         part * LANES;
}
static inline size_t line_at(HexplaneGrid grid, int level, int axis, Corner c, int part) {
  const uint r = (uint)grid.resolution << level;
  const uint start = 3 * grid.resolution * ((1u << level) - 1);  // lines of the levels before
  return (size_t)(start + axis * r + c.at[axis].cell) * CHANNELS + part * LANES;
}

typedef struct Patch {  // the four cells around a place
  lane a, b, c, d;      // (u, v), (u + 1, v), (u, v + 1), (u + 1, v + 1)
} Patch;
static inline Patch load_patch(global const float* p, uint resolution) {
  Patch o;
  o.a = ROW_LOAD(p);
  o.b = ROW_LOAD(p + CHANNELS);
  o.c = ROW_LOAD(p + (size_t)resolution * CHANNELS);
  o.d = ROW_LOAD(p + (size_t)(resolution + 1) * CHANNELS);
  return o;
}
static inline lane between(lane a, lane b, float share) { return fma(b - a, TO_LANE(share), a); }
static inline lane patch_value(Patch p, float u, float v) {
  return between(between(p.a, p.b, u), between(p.c, p.d, u), v);
}

// LANES channels of a level's features.
static inline lane features_of(HexplaneGrid grid, int level, Corner c, int part,
                               global const float* planes, global const float* lines) {
  lane product = TO_LANE(1.f);
  for (int plane = 0; plane < 3; ++plane)
    product *= patch_value(
        load_patch(planes + cell_at(grid, level, plane, c, part), (uint)grid.resolution << level),
        c.at[PLANE_U(plane)].share, c.at[PLANE_V(plane)].share);
  for (int axis = 0; axis < 3; ++axis) {
    global const float* p = lines + line_at(grid, level, axis, c, part);
    product *= between(ROW_LOAD(p), ROW_LOAD(p + CHANNELS), c.at[axis].share);
  }
  return product;
}

// The time planes at one time. One work-item per line cell and vector of channels.
kernel void hexplane_slice(const HexplaneGrid grid, const TimeRows rows,
                         global const float* restrict planes, global float* restrict lines) {
  const uint id = get_global_id(0), part = id % PARTS;
  uint cell = id / PARTS;
  for (int level = 0; level < LEVELS; ++level) {
    const uint r = (uint)grid.resolution << level;
    if (cell < 3 * r) {
      const uint start = hexplane_level_start(grid.resolution, grid.times, level) + 3 * r * r;
      lane sum = TO_LANE(0.f);
      for (int k = 0; k < 4; ++k) {
        if (rows.weight[k] == 0.f) continue;
        const size_t row = start + (size_t)(rows.row + k) * 3 * r + cell;
        sum = fma(ROW_LOAD(planes + row * CHANNELS + part * LANES), TO_LANE(rows.weight[k]), sum);
      }
      ROW_STORE(sum, lines + (size_t)id * LANES);
      return;
    }
    cell -= 3 * r;
  }
}

// From the features to the cells and the canonical means. Each chunk of `length` Gaussians adds to
// its own copy of the planes at one time, [level][XY, XZ, YZ, line X, line Y, line Z][CHANNELS].
// One work-item per chunk and vector of features; no other one accesses its columns.
kernel void hexplane_bwd_planes(const uint n, const uint length, const HexplaneGrid grid,
                                global const uint* restrict tiles_touched,
                                global const float* restrict means,
                                global const float* restrict planes,
                                global const float* restrict lines,
                                global const float* restrict v_features,  // [N, FEATURES]
                                global float* restrict v_slices,      // [chunks, cells, CHANNELS]
                                global float* restrict v_places) {  // [N, FEATURE_PARTS, 3]
  const uint chunk = get_global_id(0) / FEATURE_PARTS, feature = get_global_id(0) % FEATURE_PARTS;
  const int level = feature / PARTS, part = feature % PARTS;
  const uint r = (uint)grid.resolution << level;
  const uint cells = hexplane_level_start(grid.resolution, 1, LEVELS);
  global float* v_cut =
      v_slices +
      ((size_t)chunk * cells + hexplane_level_start(grid.resolution, 1, level)) * CHANNELS +
      part * LANES;
  for (uint cell = 0; cell < hexplane_level_rows(r, 1); ++cell)
    ROW_STORE(TO_LANE(0.f), v_cut + (size_t)cell * CHANNELS);
  const uint begin = chunk * length, end = min(n, begin + length);
  for (uint i = begin; i < end; ++i) {
    if (tiles_touched[i] == 0) continue;
    const Corner c = corner_of(load3(means, i), grid, level);
    Patch patches[3];
    lane value[6], ends[6], after[6];
#pragma unroll
    for (int p = 0; p < 3; ++p) {
      patches[p] = load_patch(planes + cell_at(grid, level, p, c, part), r);
      value[p] = patch_value(patches[p], c.at[PLANE_U(p)].share, c.at[PLANE_V(p)].share);
    }
#pragma unroll
    for (int axis = 0; axis < 3; ++axis) {
      global const float* p = lines + line_at(grid, level, axis, c, part);
      const lane a = ROW_LOAD(p), b = ROW_LOAD(p + CHANNELS);
      value[3 + axis] = between(a, b, c.at[axis].share);
      ends[3 + axis] = b - a;
    }
    // the product of all other factors: those before, which include the gradient, and those after
    after[5] = TO_LANE(1.f);
#pragma unroll
    for (int p = 4; p >= 0; --p) after[p] = after[p + 1] * value[p + 1];
    lane before = ROW_LOAD(v_features + (size_t)i * FEATURES + feature * LANES);
    lane v_at[3] = {TO_LANE(0.f), TO_LANE(0.f), TO_LANE(0.f)};
#pragma unroll
    for (int p = 0; p < 3; ++p) {
      const lane v = before * after[p];
      before *= value[p];
      const int axis_u = PLANE_U(p), axis_v = PLANE_V(p);
      const Patch q = patches[p];
      const lane share_u = TO_LANE(c.at[axis_u].share), share_v = TO_LANE(c.at[axis_v].share);
      v_at[axis_u] += v * fma(share_v, (q.d - q.c) - (q.b - q.a), q.b - q.a);
      v_at[axis_v] += v * fma(share_u, (q.d - q.b) - (q.c - q.a), q.c - q.a);
      global float* cell =
          v_cut + (size_t)((p * r + c.at[axis_v].cell) * r + c.at[axis_u].cell) * CHANNELS;
      global float* next = cell + (size_t)r * CHANNELS;
      const lane far = v * share_v, near = v - far, near_far = near * share_u,
                 far_far = far * share_u;
      ROW_STORE(ROW_LOAD(cell) + (near - near_far), cell);
      ROW_STORE(ROW_LOAD(cell + CHANNELS) + near_far, cell + CHANNELS);
      ROW_STORE(ROW_LOAD(next) + (far - far_far), next);
      ROW_STORE(ROW_LOAD(next + CHANNELS) + far_far, next + CHANNELS);
    }
#pragma unroll
    for (int axis = 0; axis < 3; ++axis) {
      const lane v = before * after[3 + axis], far = v * TO_LANE(c.at[axis].share);
      before *= value[3 + axis];
      v_at[axis] += v * ends[3 + axis];
      global float* cell = v_cut + (size_t)(3 * r * r + axis * r + c.at[axis].cell) * CHANNELS;
      ROW_STORE(ROW_LOAD(cell) + (v - far), cell);
      ROW_STORE(ROW_LOAD(cell + CHANNELS) + far, cell + CHANNELS);
    }
    store3(v_places, i * FEATURE_PARTS + feature,
           make_real3(ROW_SUM(v_at[0]) * c.at[0].per_world, ROW_SUM(v_at[1]) * c.at[1].per_world,
                      ROW_SUM(v_at[2]) * c.at[2].per_world));
  }
}

// Adds the gradient through the features to v_means. One work-item per Gaussian.
kernel void hexplane_bwd_means(const uint n, global const uint* restrict tiles_touched,
                               global const float* restrict v_places,  // [N, FEATURE_PARTS, 3]
                               global float* restrict v_means) {       // [N, 3]
  const uint i = get_global_id(0);
  if (i >= n || tiles_touched[i] == 0) return;
  real3 sum = load3(v_means, i);
  for (uint f = 0; f < FEATURE_PARTS; ++f) sum += load3(v_places, i * FEATURE_PARTS + f);
  store3(v_means, i, sum);
}

static inline void put_cell(global uint* seen, global float* v_planes, uint row, const lane* sum,
                            float weight) {
  for (int part = 0; part < PARTS; ++part) {
    global float* v = v_planes + (size_t)row * CHANNELS + part * LANES;
    const lane share = sum[part] * TO_LANE(weight);
    ROW_STORE(seen[row] ? ROW_LOAD(v) + share : share, v);
  }
  seen[row] = 1;
}

// Sums the chunks' copies, and sets or adds what is not 0. One work-item per cell of a copy.
kernel void hexplane_sum_planes(const uint chunks, const HexplaneGrid grid, const TimeRows rows,
                                global const float* restrict v_slices,
                                global uint* restrict seen, global float* restrict v_planes) {
  const uint cells = hexplane_level_start(grid.resolution, 1, LEVELS);
  uint cell = get_global_id(0);
  if (cell >= cells) return;
  lane sum[PARTS];
  float size = 0.f;
  for (int part = 0; part < PARTS; ++part) {
    sum[part] = TO_LANE(0.f);
    for (uint c = 0; c < chunks; ++c)
      sum[part] += ROW_LOAD(v_slices + ((size_t)c * cells + cell) * CHANNELS + part * LANES);
    size += ROW_SUM(fabs(sum[part]));
  }
  if (size == 0.f) return;  // NaN continues, for Adam to reject
  for (int level = 0; level < LEVELS; ++level) {
    const uint r = (uint)grid.resolution << level,
               start = hexplane_level_start(grid.resolution, grid.times, level);
    if (cell < 3 * r * r) {
      put_cell(seen, v_planes, start + cell, sum, 1.f);
      return;
    }
    cell -= 3 * r * r;
    if (cell < 3 * r) {
      for (int k = 0; k < 4; ++k) {
        if (rows.weight[k] == 0.f) continue;
        const uint line = start + 3 * r * r + (rows.row + k) * 3 * r + cell;
        put_cell(seen, v_planes, line, sum, rows.weight[k]);
      }
      return;
    }
    cell -= 3 * r;
  }
}

// Adds the gradient of these terms, summed over levels and planes:
//   plane_tv         planes of space: mean (p' - p)^2 between neighbours, both directions summed
//   time_smoothness  planes of time: mean (p'' - 2 p' + p)^2 of three rows in time
//   l1_time          planes of time: mean |p - 1|
// One work-item per row of the planes.
kernel void hexplane_regularize(const HexplaneGrid grid, const float plane_tv,
                                const float time_smoothness, const float l1_time,
                                global const float* restrict planes, global uint* restrict seen,
                                global float* restrict v_planes) {
  const uint row = get_global_id(0);
  if (row >= hexplane_level_start(grid.resolution, grid.times, LEVELS)) return;
  uint at = row;
  int level = 0;
  while (at >= hexplane_level_rows((uint)grid.resolution << level, grid.times)) {
    at -= hexplane_level_rows((uint)grid.resolution << level, grid.times);
    ++level;
  }
  const int r = grid.resolution << level, times = grid.times;
  const int of_space = at < (uint)(3 * r * r);
  lane sum[PARTS];
  float size = 0.f;
  for (int part = 0; part < PARTS; ++part) {
    global const float* p = planes + (size_t)row * CHANNELS + part * LANES;
    const lane here = ROW_LOAD(p);
    lane g = TO_LANE(0.f);
    if (of_space) {
      const int u = at % r, v = at / r % r;
      if (u > 0) g += here - ROW_LOAD(p - CHANNELS);
      if (u < r - 1) g += here - ROW_LOAD(p + CHANNELS);
      if (v > 0) g += here - ROW_LOAD(p - (size_t)r * CHANNELS);
      if (v < r - 1) g += here - ROW_LOAD(p + (size_t)r * CHANNELS);
      g *= TO_LANE(2.f * plane_tv / ((float)r * (r - 1) * CHANNELS));
    } else {
      const int k = (at - 3 * r * r) / (3 * r);
      const size_t step = (size_t)3 * r * CHANNELS;
      const float mean = 1.f / ((float)max(times - 2, 1) * r * CHANNELS);
      if (k >= 2) g += ROW_LOAD(p - 2 * step) - 2.f * ROW_LOAD(p - step) + here;
      if (k >= 1 && k < times - 1)
        g -= 2.f * (ROW_LOAD(p - step) - 2.f * here + ROW_LOAD(p + step));
      if (k < times - 2) g += here - 2.f * ROW_LOAD(p + step) + ROW_LOAD(p + 2 * step);
      g *= TO_LANE(2.f * time_smoothness * mean);
      const lane away = here - TO_LANE(1.f);
      const lane direction =
          LANE_SELECT(LANE_SELECT(TO_LANE(0.f), TO_LANE(-1.f), away < TO_LANE(0.f)), TO_LANE(1.f),
                      away > TO_LANE(0.f));
      g = fma(TO_LANE(l1_time / ((float)times * r * CHANNELS)), direction, g);
    }
    sum[part] = g;
    size += ROW_SUM(fabs(g));
  }
  if (size == 0.f) return;
  put_cell(seen, v_planes, row, sum, 1.f);
}
