// SPDX-License-Identifier: Apache-2.0
// The keyframes motion model on the device: Gaussians on paths through keys, and the gradient.
// Windows, first and second time, and outputs are as in native4d.cl. One work-item per Gaussian.
#include "shared/motion/canonical_rows.h"
#include "shared/motion/culling.h"
#include "shared/motion/keys.h"
#include "shared/unrolled.h"

#ifndef SCALES  // whether sizes have keys; only for the syntax check, the host always defines it
#define SCALES 1
#endif

// Row k M + i of the tables is key k of Gaussian i of the M dynamic ones; static ones do not move.
static inline Shift shift_at(uint moving, uint i, KeyWeights keys, global const float* key_shifts,
                             global const float* key_turns, global const float* key_scales) {
  Shift d;
  d.mean = make_real3(0.f, 0.f, 0.f);
  d.quat = make_real4(0.f, 0.f, 0.f, 0.f);
  d.log_scales = make_real3(0.f, 0.f, 0.f);
  if (i >= moving) return d;
  FOR_UNROLLED(k, 0, KEYS_AT_ONCE, keys.count) {
    const uint row = (keys.first + k) * moving + i;
    d.mean += load3(key_shifts, row) * keys.weight[k];
    d.quat += load4(key_turns, row) * keys.weight[k];
    if (SCALES) d.log_scales += load3(key_scales, row) * keys.weight[k];
  }
  return d;
}

kernel void keyframes_fwd(const uint n, const uint moving, const float t, const float sigmas,
                          const int first, const KeyWeights keys, global const uint* restrict rows,
                          global const uint* restrict tiles_touched,  // [n] read if not first
                          CANONICAL_IN, global const float* restrict key_shifts,  // [K, M, 3]
                          global const float* restrict key_turns,                 // [K, M, 4]
                          global const float* restrict key_scales,  // [K, M, 3] read if SCALES
                          global float* restrict means_at,          // [n, 3]
                          global float* restrict factors_at,        // [n, 3, 3]
                          global float* restrict opacities_at) {    // [n]
  const uint k = get_global_id(0);
  if (k >= n) return;
  const uint i = view_row(k, rows);
  if (!canonical_in_window(i, k, t, sigmas, first, tiles_touched, means_t, log_scales,
                           opacities_at))
    return;
  const Shift d = shift_at(moving, i, keys, key_shifts, key_turns, key_scales);
  store_shifted(k, shifted_at(load_canonical(i, CANONICAL_ROWS), d, t), means_at, factors_at,
                opacities_at);
}

// Culls rows that a camera cannot see at time t, as spacetime_cull (spacetime.cl).
kernel void keyframes_cull(const uint n, const uint moving, const float t, const float sigmas,
                           const PinholeCamera camera, const KeyWeights keys, CANONICAL_IN,
                           global const float* restrict key_shifts,
                           global const float* restrict key_turns,
                           global const float* restrict key_scales,
                           global uint* restrict marks,     // [ceil(N / LANES)]
                           global uint* restrict counts) {  // [ceil(N / LANES)] their bits
  const uint group = get_global_id(0), first = group * LANES;
  if (first >= n) return;
  CullInputs culling;
  LaneInts shown;
  shown.all = cull_time(&culling, first, n, t, sigmas, means_t, log_scales);
  if (lane_any(shown.all)) {
    cull_clear(&culling);
    for (uint i = first, r = 0; i < n && r < LANES; ++i, ++r) {
      const Shift d = shift_at(moving, i, keys, key_shifts, key_turns, key_scales);
      const float4 log_scales_at = vload4(i, log_scales) + (float4)(d.log_scales, 0.f);
      cull_put(&culling, r, load3(means, i) + d.mean, log_scales_at, logit_opacities[i]);
    }
    shown.all &= cull_visible(culling, camera);
  }
  cull_mark(group, n, shown, marks, counts);
}

// The first time that touches a key in a training step sets its gradient, a later one adds to it.
kernel void keyframes_bwd(const uint n, const uint moving, const float t, const int first,
                          const KeyWeights keys, global const uint* restrict rows, CANONICAL_IN,
                          global const float* restrict key_shifts,
                          global const float* restrict key_turns,
                          global const float* restrict key_scales,
                          global const uint* restrict tiles_touched,    // [n]
                          global const float* restrict v_means_at,      // [n, 3]
                          global const float* restrict v_factors_at,    // [n, 3, 3]
                          global const float* restrict v_opacities_at,  // [n] read if first
                          global uint* restrict seen, V_CANONICAL_OUT,
                          global uint* restrict keys_seen,  // [K, M]
                          global float* restrict v_key_shifts, global float* restrict v_key_turns,
                          global float* restrict v_key_scales) {  // written if SCALES
  const uint entry = get_global_id(0);
  if (entry >= n || tiles_touched[entry] == 0) return;
  const uint i = view_row(entry, rows);
  const Shift d = shift_at(moving, i, keys, key_shifts, key_turns, key_scales);
  const Canonical v =
      shifted_vjp(load_canonical(i, CANONICAL_ROWS), d, t, load3(v_means_at, entry),
                  load_mat3(v_factors_at, entry), first ? v_opacities_at[entry] : 0.f);
  const int fresh = first && !seen[i];
  if (fresh) seen[i] = 1;
  put_canonical(i, v, fresh, V_CANONICAL_ROWS);
  if (i >= moving) return;
  FOR_UNROLLED(k, 0, KEYS_AT_ONCE, keys.count) {
    const float w = keys.weight[k];
    const uint row = (keys.first + k) * moving + i;
    const real3 v_scales = make_real3(v.log_scales.x, v.log_scales.y, v.log_scales.z) * w;
    if (w == 0.f) continue;
    if (keys_seen[row]) {
      add3(v_key_shifts, row, v.mean * w);
      add4(v_key_turns, row, v.quat * w);
      if (SCALES) add3(v_key_scales, row, v_scales);
    } else {
      keys_seen[row] = 1;
      store3(v_key_shifts, row, v.mean * w);
      vstore4(v.quat * w, row, v_key_turns);
      if (SCALES) store3(v_key_scales, row, v_scales);
    }
  }
}

// Extrapolates key `key` of the dynamic Gaussians linearly from the two keys before it; key 1 is a
// copy of key 0. One work-item per float.
kernel void keyframes_start(const uint moving, const uint width, const uint key,
                            global float* restrict values) {  // [K, M, width]
  const uint at = get_global_id(0), block = moving * width;
  if (at >= block) return;
  const float last = values[(key - 1) * block + at];
  const float before = key > 1 ? values[(key - 2) * block + at] : last;
  values[key * block + at] = 2.f * last - before;
}
