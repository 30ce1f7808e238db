// SPDX-License-Identifier: Apache-2.0
// The native4d motion model on the device: Gaussians in space-time cut at time t, and back.
// A Gaussian whose temporal weight is at most `cutoff` gets opacity 0 and is touched no further:
// that is the time window, applied before projection. One work-item a Gaussian.
#include "shared/arrays.h"
#include "shared/native4d.h"

static inline Native4d load_native4d(uint i, global const float* means, global const float* means_t,
                                     global const float* quats, global const float* quats_r,
                                     global const float* log_scales,
                                     global const float* logit_opacities) {
  Native4d g;
  g.mean = load3(means, i);
  g.mean_t = means_t[i];
  g.quat = load4(quats, i);
  g.quat_r = load4(quats_r, i);
  g.log_scales = load4(log_scales, i);
  g.logit_opacity = logit_opacities[i];
  return g;
}

// ignore_window = 1 keeps every Gaussian (for t2: what is seen at t1 still moves when it fades).
kernel void native4d_fwd(const uint n, const float t, const float cutoff, const int ignore_window,
                         global const float* restrict means,            // [N, 3]
                         global const float* restrict means_t,          // [N]
                         global const float* restrict quats,            // [N, 4] ql
                         global const float* restrict quats_r,          // [N, 4] qr
                         global const float* restrict log_scales,       // [N, 4] x y z t
                         global const float* restrict logit_opacities,  // [N]
                         global float* restrict means_at,               // [N, 3]
                         global float* restrict factors_at,             // [N, 3, 3]
                         global float* restrict opacities_at) {         // [N]
  const uint i = get_global_id(0);
  if (i >= n) return;
  const Native4d g = load_native4d(i, means, means_t, quats, quats_r, log_scales, logit_opacities);
  const Slice s = slice_at(g, t);
  const int there = s.marginal > cutoff || ignore_window;
  opacities_at[i] = there ? s.opacity : 0.f;
  store3(means_at, i, s.mean);
  store_mat3(factors_at, i, s.factor);
}

// Adds to the parameter gradients of what was seen; leaves the rest alone.
kernel void native4d_bwd(const uint n, const float t, global const float* restrict means,
                         global const float* restrict means_t, global const float* restrict quats,
                         global const float* restrict quats_r,
                         global const float* restrict log_scales,
                         global const float* restrict logit_opacities,
                         global const uint* restrict tiles_touched,
                         global const float* restrict v_means_at,      // [N, 3]
                         global const float* restrict v_factors_at,    // [N, 3, 3]
                         global const float* restrict v_opacities_at,  // [N]
                         const int with_opacity,                       // 0: v_opacities_at unread
                         global float* restrict v_means, global float* restrict v_means_t,
                         global float* restrict v_quats, global float* restrict v_quats_r,
                         global float* restrict v_log_scales,
                         global float* restrict v_logit_opacities) {
  const uint i = get_global_id(0);
  if (i >= n || tiles_touched[i] == 0) return;
  const Native4d g = load_native4d(i, means, means_t, quats, quats_r, log_scales, logit_opacities);
  const Native4d v = slice_vjp(g, t, load3(v_means_at, i), load_mat3(v_factors_at, i),
                               with_opacity ? v_opacities_at[i] : 0.f);
  add3(v_means, i, v.mean);
  v_means_t[i] += v.mean_t;
  add4(v_quats, i, v.quat);
  add4(v_quats_r, i, v.quat_r);
  add4(v_log_scales, i, v.log_scales);
  v_logit_opacities[i] += v.logit_opacity;
}
