// SPDX-License-Identifier: Apache-2.0
// The hexplane motion model on the device (formulas and layouts: shared/motion/hexplane.h). Blocks
// of Gaussians and sums over chunks are as in network.cl.
#include "motion/plane_field.cl"
#include "shared/motion/canonical_rows.h"

static inline Shift shift_of(const float* o, HexplaneGrid grid) {
  Shift d;
  d.mean = make_real3(grid.half_size[0] * o[0], grid.half_size[1] * o[1], grid.half_size[2] * o[2]);
  d.quat = TURN ? make_real4(o[3], o[4], o[5], o[6]) : make_real4(0.f, 0.f, 0.f, 0.f);
  d.log_scales =
      RESIZE ? make_real3(log_scale_change(o[7]), log_scale_change(o[8]), log_scale_change(o[9]))
             : make_real3(0.f, 0.f, 0.f);
  return d;
}
static inline void shift_of_vjp(Shift d, Canonical v, HexplaneGrid grid, float* v_o) {
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

// One work-item per `per_item` Gaussians. Windows, first and second time as in native4d.cl. Rows
// from `moving` on are static: the field does not shift them.
kernel void hexplane_fwd(const uint n, const uint moving, const uint per_item, const float t,
                         const float sigmas, const int first, const HexplaneGrid grid,
                         global const uint* restrict tiles_touched,  // [N] read if not first
                         CANONICAL_IN, global const float* restrict planes,
                         global const float* restrict lines, global const float* restrict network,
                         global float* restrict means_at,        // [N, 3]
                         global float* restrict factors_at,      // [N, 3, 3]
                         global float* restrict opacities_at) {  // [N]
  const uint begin = get_global_id(0) * per_item, end = min(n, begin + per_item);
  Activations a;
  uint rows[BLOCK];
  int count = 0;
  for (uint i = begin; i < end; ++i) {
    if (canonical_in_window(i, i, t, sigmas, first, tiles_touched, means_t, log_scales,
                            opacities_at)) {
      if (i < moving)
        rows[count++] = i;
      else
        store_shifted(i, shifted_at(load_canonical(i, CANONICAL_ROWS), no_shift(), t), means_at,
                      factors_at, opacities_at);
    }
    if (count == 0 || (count < BLOCK && i + 1 < end)) continue;
    field_fwd(rows, count, grid, means, planes, lines, network, &a);
    for (int b = 0; b < count; ++b)
      store_shifted(rows[b],
                    shifted_at(load_canonical(rows[b], CANONICAL_ROWS),
                               shift_of(a.outputs + b * OUTPUTS, grid), t),
                    means_at, factors_at, opacities_at);
    count = 0;
  }
}

// Sets or adds the gradients of a row's canonical parameters at a constant shift; returns them.
static inline Canonical shift_bwd(uint i, Shift d, float t, int first, CANONICAL_IN,
                                  global const float* restrict v_means_at,
                                  global const float* restrict v_factors_at,
                                  global const float* restrict v_opacities_at,
                                  global uint* restrict seen, V_CANONICAL_OUT) {
  const Canonical v = shifted_vjp(load_canonical(i, CANONICAL_ROWS), d, t, load3(v_means_at, i),
                                  load_mat3(v_factors_at, i), first ? v_opacities_at[i] : 0.f);
  const int fresh = first && !seen[i];
  if (fresh) seen[i] = 1;
  put_canonical(i, v, fresh, V_CANONICAL_ROWS);
  return v;
}

// Gradients of the canonical parameters (except those through the features), of the features, and
// of the network: CPUs sum the latter in v_networks, GPUs store its factors in `kept`. One
// work-item per chunk of `length` Gaussians.
kernel void hexplane_bwd(const uint n, const uint moving, const uint length, const float t,
                         const int first, const HexplaneGrid grid, CANONICAL_IN,
                         global const float* restrict planes, global const float* restrict lines,
                         global const float* restrict network,
                         global const float* restrict transposed,
                         global const uint* restrict tiles_touched,
                         global const float* restrict v_means_at,      // [N, 3]
                         global const float* restrict v_factors_at,    // [N, 3, 3]
                         global const float* restrict v_opacities_at,  // [N] read if first
                         global uint* restrict seen, V_CANONICAL_OUT,
                         global float* restrict v_features,  // [N, FEATURES] of visible rows
                         global float* restrict v_networks,  // [chunks, WEIGHTS]; CPU
                         global float* restrict kept) {      // [N, KEPT]; GPU
  const uint chunk = get_global_id(0), begin = chunk * length, end = min(n, begin + length);
  Activations a;
  float v_out[BLOCK * OUTPUTS], v_x[BLOCK * FEATURES];
  uint rows[BLOCK];
  int count = 0;
  global float* v_network = v_networks + (size_t)chunk * WEIGHTS;
#if LANES > 1
  for (uint w = 0; w < WEIGHTS; w += LANES) ROW_STORE(TO_LANE(0.f), v_network + w);
#endif
  for (uint i = begin; i < end; ++i) {
    if (tiles_touched[i] != 0) {
      if (i < moving)
        rows[count++] = i;
      else
        shift_bwd(i, no_shift(), t, first, CANONICAL_ROWS, v_means_at, v_factors_at, v_opacities_at,
                  seen, V_CANONICAL_ROWS);
    }
    if (count == 0 || (count < BLOCK && i + 1 < end)) continue;
    field_fwd(rows, count, grid, means, planes, lines, network, &a);
    for (int k = 0; k < BLOCK * OUTPUTS; ++k) v_out[k] = 0.f;
    for (int b = 0; b < count; ++b) {
      const uint row = rows[b];
      const Shift d = shift_of(a.outputs + b * OUTPUTS, grid);
      const Canonical v = shift_bwd(row, d, t, first, CANONICAL_ROWS, v_means_at, v_factors_at,
                                    v_opacities_at, seen, V_CANONICAL_ROWS);
      shift_of_vjp(d, v, grid, v_out + b * OUTPUTS);
      // A broken Gaussian keeps its non-finite gradient, but must not affect the shared network.
      float sum = 0.f;
      for (int k = 0; k < OUTPUTS; ++k) sum += v_out[b * OUTPUTS + k];
      if (!is_finite_real(sum))
        for (int k = 0; k < OUTPUTS; ++k) v_out[b * OUTPUTS + k] = 0.f;
    }
    network_bwd(&a, v_out, transposed, v_network, kept + (size_t)rows[0] * KEPT, v_x);
    for (int b = 0; b < count; ++b)
      for (int k = 0; k < FEATURES; k += LANES)
        ROW_STORE(ROW_LOAD(v_x + b * FEATURES + k), v_features + (size_t)rows[b] * FEATURES + k);
    count = 0;
  }
}
