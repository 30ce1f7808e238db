// SPDX-License-Identifier: Apache-2.0
// The hexplane motion model on the device (formulas and layouts: shared/hexplane.h). CPUs process a
// block of Gaussians at once, so that each weight read serves all of them, with LANES channels or
// neurons per vector; GPUs process one Gaussian per work-item. Forward keeps no activations:
// backward recomputes them. Sums over Gaussians are made per chunk, each into memory of its own,
// then over the chunks in order: bitwise repeatable, without atomics.
#include "shared/hexplane.h"
#include "shared/lane_row.h"
#include "shared/canonical_rows.h"

#ifndef LEVELS  // only for the syntax check; the host always defines it
#define LEVELS 2
#define CHANNELS 16
#define HIDDEN 64
#define LAYERS 2
#define TURN 1
#define RESIZE 1
#endif
#define FEATURES (LEVELS * CHANNELS)
#define PARTS (CHANNELS / LANES)          // vectors per level
#define FEATURE_PARTS (FEATURES / LANES)  // of all levels
#define OUTPUTS HEXPLANE_OUTPUTS
#if LANES == 1
#define BLOCK 1  // Gaussians at once
#define ROWS 1   // of these, rows held in registers by a layer, two vectors each
#else
#define BLOCK 32
#define ROWS (LANES == 16 ? 8 : 4)
#endif

// ---- one Gaussian on the planes

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

// ---- the network on a block of Gaussians

// out [BLOCK, outputs] = in [BLOCK, inputs] w [inputs, outputs], plus w's next row, the bias, if
// `biased`. Two vectors of outputs at a time; a last one without a partner is computed twice.
static inline void layer_fwd(const float* in, const int inputs, global const float* w,
                             const int outputs, const int biased, float* out) {
  for (int j = 0; j < outputs; j += 2 * LANES) {
    const int j2 = j + LANES < outputs ? j + LANES : j;
    global const float* bias = w + (size_t)inputs * outputs;
    for (int b = 0; b < BLOCK; b += ROWS) {
      lane one[ROWS], two[ROWS];
#pragma unroll
      for (int u = 0; u < ROWS; ++u) {
        one[u] = biased ? ROW_LOAD(bias + j) : TO_LANE(0.f);
        two[u] = biased ? ROW_LOAD(bias + j2) : TO_LANE(0.f);
      }
      for (int k = 0; k < inputs; ++k) {
        const lane w1 = ROW_LOAD(w + (size_t)k * outputs + j);
        const lane w2 = ROW_LOAD(w + (size_t)k * outputs + j2);
#pragma unroll
        for (int u = 0; u < ROWS; ++u) {
          const lane x = TO_LANE(in[(b + u) * inputs + k]);
          one[u] = fma(x, w1, one[u]);
          two[u] = fma(x, w2, two[u]);
        }
      }
#pragma unroll
      for (int u = 0; u < ROWS; ++u) {
        ROW_STORE(one[u], out + (b + u) * outputs + j);
        ROW_STORE(two[u], out + (b + u) * outputs + j2);
      }
    }
  }
}

#if LANES > 1
// v_w [inputs + 1, outputs] += in^T v_out, and its last row the sum of v_out.
static inline void layer_bwd_weights(const float* in, const int inputs, const float* v_out,
                                     const int outputs, global float* v_w) {
  for (int j = 0; j < outputs; j += LANES) {
    for (int k = 0; k < inputs; k += ROWS) {
      lane sum[ROWS];
#pragma unroll
      for (int u = 0; u < ROWS; ++u) sum[u] = ROW_LOAD(v_w + (size_t)(k + u) * outputs + j);
      for (int b = 0; b < BLOCK; ++b) {
        const lane v = ROW_LOAD(v_out + b * outputs + j);
#pragma unroll
        for (int u = 0; u < ROWS; ++u) sum[u] = fma(TO_LANE(in[b * inputs + k + u]), v, sum[u]);
      }
#pragma unroll
      for (int u = 0; u < ROWS; ++u) ROW_STORE(sum[u], v_w + (size_t)(k + u) * outputs + j);
    }
    lane sum = ROW_LOAD(v_w + (size_t)inputs * outputs + j);
    for (int b = 0; b < BLOCK; ++b) sum += ROW_LOAD(v_out + b * outputs + j);
    ROW_STORE(sum, v_w + (size_t)inputs * outputs + j);
  }
}
#endif

#define LAYER_START(layer) hexplane_weights(FEATURES, HIDDEN, layer)
#define LAYER_INPUTS(layer) ((layer) == 0 ? FEATURES : HIDDEN)
#define LAYER_OUTPUTS(layer) ((layer) == LAYERS ? OUTPUTS : HIDDEN)
#define WEIGHTS (LAYER_START(LAYERS) + (HIDDEN + 1) * OUTPUTS)

// Inputs of all layers, then the outputs.
typedef struct Activations {
  float features[BLOCK * FEATURES];
  float hidden[LAYERS][BLOCK * HIDDEN];
  float outputs[BLOCK * OUTPUTS];
} Activations;

// For the Gaussians rows[0 .. count - 1]; the remaining entries of the block repeat the last one.
static inline void network_fwd(const uint* rows, int count, HexplaneGrid grid,
                               global const float* means, global const float* planes,
                               global const float* lines, global const float* network,
                               Activations* a) {
  for (int b = 0; b < BLOCK; ++b) {
    const real3 mean = load3(means, rows[min(b, count - 1)]);
    for (int level = 0; level < LEVELS; ++level) {
      const Corner c = corner_of(mean, grid, level);
      for (int part = 0; part < PARTS; ++part)
        ROW_STORE(features_of(grid, level, c, part, planes, lines),
                  a->features + b * FEATURES + level * CHANNELS + part * LANES);
    }
  }
  layer_fwd(a->features, FEATURES, network, HIDDEN, 1, a->hidden[0]);
  for (int layer = 1; layer <= LAYERS; ++layer) {
    float* in = a->hidden[layer - 1];
    for (int k = 0; k < BLOCK * HIDDEN; k += LANES)
      ROW_STORE(fmax(ROW_LOAD(in + k), TO_LANE(0.f)), in + k);
    if (layer < LAYERS)
      layer_fwd(in, HIDDEN, network + LAYER_START(layer), HIDDEN, 1, a->hidden[layer]);
  }
  layer_fwd(a->hidden[LAYERS - 1], HIDDEN, network + LAYER_START(LAYERS), OUTPUTS, 1, a->outputs);
}

static inline Shift shift_of(const float* o, HexplaneGrid grid) {
  Shift d;
  d.mean = make_real3(grid.half_size[0] * o[0], grid.half_size[1] * o[1], grid.half_size[2] * o[2]);
  d.quat = TURN ? make_real4(o[3], o[4], o[5], o[6]) : make_real4(0.f, 0.f, 0.f, 0.f);
  d.log_scales = RESIZE ? make_real3(log_scale_change(o[7]), log_scale_change(o[8]), log_scale_change(o[9]))
                        : make_real3(0.f, 0.f, 0.f);
  return d;
}
static inline void shift_of_vjp(Shift d, Still v, HexplaneGrid grid, float* v_o) {
  v_o[0] = grid.half_size[0] * v.mean.x;
  v_o[1] = grid.half_size[1] * v.mean.y;
  v_o[2] = grid.half_size[2] * v.mean.z;
  v_o[3] = TURN ? v.quat.x : 0.f;
  v_o[4] = TURN ? v.quat.y : 0.f;
  v_o[5] = TURN ? v.quat.z : 0.f;
  v_o[6] = TURN ? v.quat.w : 0.f;
  v_o[7] = RESIZE ? v.log_scales.x * log_scale_change_slope(d.log_scales.x) : 0.f;
  v_o[8] = RESIZE ? v.log_scales.y * log_scale_change_slope(d.log_scales.y) : 0.f;
  v_o[9] = RESIZE ? v.log_scales.z * log_scale_change_slope(d.log_scales.z) : 0.f;
}

// ---- forward

// Interpolates the time planes at one time, between rows `row` and row + 1. One work-item per line
// cell and vector of channels.
kernel void hexplane_slice(const HexplaneGrid grid, const int row, const float share,
                         global const float* restrict planes, global float* restrict lines) {
  const uint id = get_global_id(0), part = id % PARTS;
  uint cell = id / PARTS;
  for (int level = 0; level < LEVELS; ++level) {
    const uint r = (uint)grid.resolution << level;
    if (cell < 3 * r) {
      const uint start = hexplane_level_start(grid.resolution, grid.times, level) + 3 * r * r;
      const int next = min(row + 1, grid.times - 1);
      const lane a =
          ROW_LOAD(planes + (size_t)(start + row * 3 * r + cell) * CHANNELS + part * LANES);
      const lane b =
          ROW_LOAD(planes + (size_t)(start + next * 3 * r + cell) * CHANNELS + part * LANES);
      ROW_STORE(between(a, b, share), lines + (size_t)id * LANES);
      return;
    }
    cell -= 3 * r;
  }
}

// One work-item per `per_item` Gaussians. Windows, first and second time as in native4d.cl.
kernel void hexplane_fwd(const uint n, const uint per_item, const float t, const float sigmas,
                         const int first, const HexplaneGrid grid,
                         global const uint* restrict tiles_touched,  // [N] read if not first
                         STILL_IN, global const float* restrict planes,
                         global const float* restrict lines, global const float* restrict network,
                         global float* restrict means_at,        // [N, 3]
                         global float* restrict factors_at,      // [N, 3, 3]
                         global float* restrict opacities_at) {  // [N]
  const uint begin = get_global_id(0) * per_item, end = min(n, begin + per_item);
  Activations a;
  uint rows[BLOCK];
  int count = 0;
  for (uint i = begin; i < end; ++i) {
    if (still_in_window(i, i, t, sigmas, first, tiles_touched, means_t, log_scales, opacities_at))
      rows[count++] = i;
    if (count == 0 || (count < BLOCK && i + 1 < end)) continue;
    network_fwd(rows, count, grid, means, planes, lines, network, &a);
    for (int b = 0; b < count; ++b)
      store_shifted(
          rows[b],
          shifted_at(load_still(rows[b], STILL_ROWS), shift_of(a.outputs + b * OUTPUTS, grid), t),
          means_at, factors_at, opacities_at);
    count = 0;
  }
}

// ---- backward

// The weights of each layer as [outputs][inputs], without bias. One work-item per weight.
kernel void hexplane_transpose(global const float* restrict network,
                               global float* restrict transposed) {
  const uint w = get_global_id(0);
  if (w >= WEIGHTS) return;
  int layer = 0;
  while (layer < LAYERS && w >= LAYER_START(layer + 1)) ++layer;
  const uint start = LAYER_START(layer), k = (w - start) / LAYER_OUTPUTS(layer);
  const uint j = (w - start) % LAYER_OUTPUTS(layer), inputs = LAYER_INPUTS(layer);
  if (k < inputs) transposed[start + j * inputs + k] = network[w];
}

// Floats that a GPU stores per Gaussian for hexplane_bwd_network: inputs of all layers, then the
// gradients of their outputs.
#define KEPT_INPUTS (FEATURES + LAYERS * HIDDEN)
#define KEPT (KEPT_INPUTS + LAYERS * HIDDEN + OUTPUTS)

// Gradients of the canonical parameters (except those through the features), of the features, and
// of the network: CPUs sum the latter in v_networks, GPUs store its factors in `kept`. One
// work-item per chunk of `length` Gaussians.
kernel void hexplane_bwd(const uint n, const uint length, const float t, const int first,
                         const HexplaneGrid grid, STILL_IN, global const float* restrict planes,
                         global const float* restrict lines, global const float* restrict network,
                         global const float* restrict transposed,
                         global const uint* restrict tiles_touched,
                         global const float* restrict v_means_at,      // [N, 3]
                         global const float* restrict v_factors_at,    // [N, 3, 3]
                         global const float* restrict v_opacities_at,  // [N] read if first
                         global uint* restrict seen, V_STILL_OUT,
                         global float* restrict v_features,  // [N, FEATURES] of visible rows
                         global float* restrict v_networks,  // [chunks, WEIGHTS]; CPU
                         global float* restrict kept) {      // [N, KEPT]; GPU
  const uint chunk = get_global_id(0), begin = chunk * length, end = min(n, begin + length);
  Activations a;
  float v_out[BLOCK * OUTPUTS], v_in[BLOCK * HIDDEN], v_next[BLOCK * HIDDEN];
  float v_x[BLOCK * FEATURES];
  uint rows[BLOCK];
  int count = 0;
#if LANES > 1
  global float* v_network = v_networks + (size_t)chunk * WEIGHTS;
  for (uint w = 0; w < WEIGHTS; w += LANES) ROW_STORE(TO_LANE(0.f), v_network + w);
#endif
  for (uint i = begin; i < end; ++i) {
    if (tiles_touched[i] != 0) rows[count++] = i;
    if (count == 0 || (count < BLOCK && i + 1 < end)) continue;
    network_fwd(rows, count, grid, means, planes, lines, network, &a);
    for (int k = 0; k < BLOCK * OUTPUTS; ++k) v_out[k] = 0.f;
    for (int b = 0; b < count; ++b) {
      const uint row = rows[b];
      const Shift d = shift_of(a.outputs + b * OUTPUTS, grid);
      const Still v = shifted_vjp(load_still(row, STILL_ROWS), d, t, load3(v_means_at, row),
                                  load_mat3(v_factors_at, row), first ? v_opacities_at[row] : 0.f);
      const int fresh = first && !seen[row];
      if (fresh) seen[row] = 1;
      put_still(row, v, fresh, V_STILL_ROWS);
      shift_of_vjp(d, v, grid, v_out + b * OUTPUTS);
      // A broken Gaussian keeps its non-finite gradient, but must not affect the shared network.
      float sum = 0.f;
      for (int k = 0; k < OUTPUTS; ++k) sum += v_out[b * OUTPUTS + k];
      if (!is_finite_real(sum))
        for (int k = 0; k < OUTPUTS; ++k) v_out[b * OUTPUTS + k] = 0.f;
    }
#if LANES == 1
    global float* keep = kept + (size_t)rows[0] * KEPT;
    for (int k = 0; k < FEATURES; ++k) keep[k] = a.features[k];
    for (int k = 0; k < LAYERS * HIDDEN; ++k) keep[FEATURES + k] = a.hidden[k / HIDDEN][k % HIDDEN];
    keep += KEPT_INPUTS;
    for (int k = 0; k < OUTPUTS; ++k) keep[LAYERS * HIDDEN + k] = v_out[k];
#else
    layer_bwd_weights(a.hidden[LAYERS - 1], HIDDEN, v_out, OUTPUTS,
                      v_network + LAYER_START(LAYERS));
#endif
    layer_fwd(v_out, OUTPUTS, transposed + LAYER_START(LAYERS), HIDDEN, 0, v_in);
    for (int layer = LAYERS - 1; layer >= 0; --layer) {
      const float* out = a.hidden[layer];
      for (int k = 0; k < BLOCK * HIDDEN; k += LANES)
        ROW_STORE(LANE_SELECT(TO_LANE(0.f), ROW_LOAD(v_in + k), ROW_LOAD(out + k) > TO_LANE(0.f)),
                  v_in + k);
#if LANES == 1
      for (int k = 0; k < HIDDEN; ++k) keep[layer * HIDDEN + k] = v_in[k];
#endif
      if (layer == 0) break;
#if LANES > 1
      layer_bwd_weights(a.hidden[layer - 1], HIDDEN, v_in, HIDDEN, v_network + LAYER_START(layer));
#endif
      layer_fwd(v_in, HIDDEN, transposed + LAYER_START(layer), HIDDEN, 0, v_next);
      for (int k = 0; k < BLOCK * HIDDEN; k += LANES) ROW_STORE(ROW_LOAD(v_next + k), v_in + k);
    }
#if LANES > 1
    layer_bwd_weights(a.features, FEATURES, v_in, HIDDEN, v_network);
#endif
    layer_fwd(v_in, HIDDEN, transposed, FEATURES, 0, v_x);
    for (int b = 0; b < count; ++b)
      for (int k = 0; k < FEATURES; k += LANES)
        ROW_STORE(ROW_LOAD(v_x + b * FEATURES + k), v_features + (size_t)rows[b] * FEATURES + k);
    count = 0;
  }
}

// GPU: each weight's gradient from `length` Gaussians. One work-item per weight and chunk.
kernel void hexplane_bwd_network(const uint n, const uint length,
                                 global const uint* restrict tiles_touched,
                                 global const float* restrict kept,    // [N, KEPT]
                                 global float* restrict v_networks) {  // [chunks, WEIGHTS]
  const uint id = get_global_id(0), w = id % WEIGHTS, begin = id / WEIGHTS * length;
  const uint end = min(n, begin + length);
  int layer = 0;
  while (layer < LAYERS && w >= LAYER_START(layer + 1)) ++layer;
  const uint start = LAYER_START(layer), k = (w - start) / LAYER_OUTPUTS(layer);
  const uint j = (w - start) % LAYER_OUTPUTS(layer);
  const uint in = layer == 0 ? k : FEATURES + (layer - 1) * HIDDEN + k;
  const uint out = KEPT_INPUTS + layer * HIDDEN + j;
  float sum = 0.f;
  for (uint i = begin; i < end; ++i) {
    if (tiles_touched[i] == 0) continue;
    global const float* keep = kept + (size_t)i * KEPT;
    sum = fma(k == LAYER_INPUTS(layer) ? 1.f : keep[in], keep[out], sum);
  }
  v_networks[id] = sum;
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
kernel void hexplane_sum_planes(const uint chunks, const HexplaneGrid grid, const int row,
                                const float share, global const float* restrict v_slices,
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
      const uint line = start + 3 * r * r + row * 3 * r + cell;
      if (share < 1.f) put_cell(seen, v_planes, line, sum, 1.f - share);
      if (share > 0.f) put_cell(seen, v_planes, line + 3 * r, sum, share);
      return;
    }
    cell -= 3 * r;
  }
}

// The same for the weights. One work-item per weight.
kernel void hexplane_sum_network(const uint chunks, global const float* restrict v_networks,
                                 global uint* restrict seen, global float* restrict v_network) {
  const uint w = get_global_id(0);
  if (w >= WEIGHTS) return;
  float sum = seen[w] ? v_network[w] : 0.f;
  for (uint c = 0; c < chunks; ++c) sum += v_networks[(size_t)c * WEIGHTS + w];
  v_network[w] = sum;
  seen[w] = 1;
}

// ---- regularisers

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
