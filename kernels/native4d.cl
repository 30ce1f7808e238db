// SPDX-License-Identifier: Apache-2.0
// The native4d motion model on the device: Gaussians in space-time cut at time t, and back.
// A Gaussian whose temporal weight is at most `cutoff` gets opacity 0 and is touched no further:
// that is the time window, applied before projection. One work-item a Gaussian.
#include "shared/arrays.h"
#include "shared/native4d.h"
#include "shared/random.h"

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

// For what was seen in this view; the rest is left alone. With first = 1 (the call for t1) the
// gradients are set for Gaussians not `seen` before in this training step, which then are; else
// they are added to, and opacities_at has no say (t2 moves, it does not show).
kernel void native4d_bwd(const uint n, const float t, const int first,
                         global const float* restrict means, global const float* restrict means_t,
                         global const float* restrict quats, global const float* restrict quats_r,
                         global const float* restrict log_scales,
                         global const float* restrict logit_opacities,
                         global const uint* restrict tiles_touched,
                         global const float* restrict v_means_at,      // [N, 3]
                         global const float* restrict v_factors_at,    // [N, 3, 3]
                         global const float* restrict v_opacities_at,  // [N]
                         global uint* restrict seen,                   // [N]
                         global float* restrict v_means, global float* restrict v_means_t,
                         global float* restrict v_quats, global float* restrict v_quats_r,
                         global float* restrict v_log_scales,
                         global float* restrict v_logit_opacities) {
  const uint i = get_global_id(0);
  if (i >= n || tiles_touched[i] == 0) return;
  const Native4d g =
      load_native4d(i, means, means_t, quats, quats_r, log_scales, logit_opacities);
  const Native4d v = slice_vjp(g, t, load3(v_means_at, i), load_mat3(v_factors_at, i),
                               first ? v_opacities_at[i] : 0.f);
  if (first && !seen[i]) {
    seen[i] = 1;
    store3(v_means, i, v.mean);
    v_means_t[i] = v.mean_t;
    vstore4(v.quat, i, v_quats);
    vstore4(v.quat_r, i, v_quats_r);
    vstore4(v.log_scales, i, v_log_scales);
    v_logit_opacities[i] = v.logit_opacity;
    return;
  }
  add3(v_means, i, v.mean);
  v_means_t[i] += v.mean_t;
  add4(v_quats, i, v.quat);
  add4(v_quats_r, i, v.quat_r);
  add4(v_log_scales, i, v.log_scales);
  v_logit_opacities[i] += v.logit_opacity;
}

// What becomes of the two children of a Gaussian (child 1 and 2; 0 is left alone). Large ones
// (longest axis above split_scale) are split: both children are drawn from the parent and smaller
// by 1.6; small ones are cloned: child 2 is drawn from the parent. Lifetimes above `static_scale_t`
// are left whole: what does not change needs no division of time. Two splats of opacity o' show what
// one of opacity o does with 1 - o = (1 - o')^2.
kernel void native4d_split(const uint n, const uint seed, const float split_scale,
                           const float static_scale_t, global const uint* restrict child,
                           global float* restrict means, global float* restrict means_t,
                           global const float* restrict quats, global const float* restrict quats_r,
                           global float* restrict log_scales,
                           global float* restrict logit_opacities) {
  const uint i = get_global_id(0);
  if (i >= n || child[i] == 0) return;
  const Native4d g =
      load_native4d(i, means, means_t, quats, quats_r, log_scales, logit_opacities);
  const real4 s = exp4(g.log_scales);
  const int large = fmax(s.x, fmax(s.y, s.z)) > split_scale;
  const int lasting = s.w > static_scale_t;
  if (large || child[i] == 2) {
    const Rows4 p = rows_of(frame4(quat_normalize(g.quat).q, quat_normalize(g.quat_r).q), s);
    const real2 n1 = random_normal2(seed, 0u, i), n2 = random_normal2(seed, 2u, i);
    const real4 draw = make_real4(n1.x, n1.y, n2.x, lasting ? 0.f : n2.y);
    store3(means, i, g.mean + make_real3(dot(p.x, draw), dot(p.y, draw), dot(p.z, draw)));
    if (!lasting) means_t[i] = g.mean_t + dot(p.t, draw);
  }
  if (large) {
    const real less = 0.470003629f;  // log 1.6
    vstore4(g.log_scales - make_real4(less, less, less, lasting ? 0.f : less), i, log_scales);
  }
  const float o = 1.f / (1.f + exp(-g.logit_opacity));
  const float half_o = clamp(1.f - sqrt(1.f - o), 1e-4f, 0.999f);
  logit_opacities[i] = log(half_o / (1.f - half_o));
}
