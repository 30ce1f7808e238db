// SPDX-License-Identifier: Apache-2.0
// The spacetime motion model on the device (formulas: shared/motion/spacetime.h): Gaussians on
// their paths at time t, and the gradient. Windows, first and second time, and outputs are as in
// native4d.cl. One work-item per Gaussian.
#include "shared/arrays.h"
#include "shared/motion/culling.h"
#include "shared/motion/spacetime.h"
#include "shared/random.h"
#include "shared/view_rows.h"

#define SPACETIME_IN                                                                            \
  global const float* restrict means, global const float* restrict means_t,                     \
      global const float* restrict velocities, global const float* restrict half_accelerations, \
      global const float* restrict quats, global const float* restrict turns,                   \
      global const float* restrict log_scales, global const float* restrict logit_opacities
#define SPACETIME_ROWS \
  means, means_t, velocities, half_accelerations, quats, turns, log_scales, logit_opacities

// Static Gaussians, from `moving` on, have no rows of velocities, half_accelerations and turns.
static inline Spacetime load_spacetime(uint i, uint moving, SPACETIME_IN) {
  Spacetime g;
  g.mean = load3(means, i);
  g.mean_t = means_t[i];
  g.velocity = g.half_acceleration = make_real3(0.f, 0.f, 0.f);
  g.turn = make_real4(0.f, 0.f, 0.f, 0.f);
  if (i < moving) {
    g.velocity = load3(velocities, i);
    g.half_acceleration = load3(half_accelerations, i);
    g.turn = load4(turns, i);
  }
  g.quat = load4(quats, i);
  g.log_scales = load4(log_scales, i);
  g.logit_opacity = logit_opacities[i];
  return g;
}

// Poses of a view. At its first time (first = 1), Gaussians outside their time window get opacity 0
// and nothing else is written for them. At a second time (first = 0), only rows with tiles_touched
// > 0 are written, whether inside their window or not, and without opacities. tiles_touched and the
// outputs have one entry per row of the view (shared/view_rows.h).
kernel void spacetime_fwd(const uint n, const uint moving, const float t, const float sigmas,
                          const int first, global const uint* restrict rows,
                          global const uint* restrict tiles_touched,  // [n] read if not first
                          SPACETIME_IN,                       // as in optim/motion/spacetime.hpp
                          global float* restrict means_at,    // [n, 3]
                          global float* restrict factors_at,  // [n, 3, 3]
                          global float* restrict opacities_at) {  // [n]
  const uint k = get_global_id(0);
  if (k >= n || (!first && tiles_touched[k] == 0)) return;
  const uint i = view_row(k, rows);
  if (first && !is_in_time_window(t - means_t[i], exp(log_scales[4 * i + 3]), sigmas)) {
    opacities_at[k] = 0.f;
    return;
  }
  const SpacetimeSlice cut = spacetime_at(load_spacetime(i, moving, SPACETIME_ROWS), t);
  if (first) opacities_at[k] = cut.life.opacity;
  store3(means_at, k, cut.mean);
  store_mat3(factors_at, k, cut.factor);
}

// Culls rows that a camera cannot see at time t: stores one bit per row, 1 if it may be visible.
// One work-item per LANES Gaussians, which are tested together.
kernel void spacetime_cull(const uint n, const uint moving, const float t, const float sigmas,
                           const PinholeCamera camera, SPACETIME_IN,
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
      const float dt = culling.dt.row[r];
      float3 mean = load3(means, i);
      if (i < moving) mean += (load3(velocities, i) + load3(half_accelerations, i) * dt) * dt;
      cull_put(&culling, r, mean, vload4(i, log_scales), logit_opacities[i]);
    }
    shown.all &= cull_visible(culling, camera);
  }
  cull_mark(group, n, shown, marks, counts);
}

// Gradients of the Gaussians visible in this view; other rows are unchanged. The call for t1 (first
// = 1) sets the gradients of Gaussians not yet `seen` in this training step and marks them;
// otherwise gradients are added.
kernel void spacetime_bwd(const uint n, const uint moving, const float t, const int first,
                          global const uint* restrict rows, SPACETIME_IN,
                          global const uint* restrict tiles_touched,    // [n]
                          global const float* restrict v_means_at,      // [n, 3]
                          global const float* restrict v_factors_at,    // [n, 3, 3]
                          global const float* restrict v_opacities_at,  // [n] read if first
                          global uint* restrict seen,                   // [N]
                          global float* restrict v_means, global float* restrict v_means_t,
                          global float* restrict v_velocities,
                          global float* restrict v_half_accelerations,
                          global float* restrict v_quats, global float* restrict v_turns,
                          global float* restrict v_log_scales,
                          global float* restrict v_logit_opacities) {
  const uint k = get_global_id(0);
  if (k >= n || tiles_touched[k] == 0) return;
  const uint i = view_row(k, rows);
  const Spacetime v =
      spacetime_vjp(load_spacetime(i, moving, SPACETIME_ROWS), t, load3(v_means_at, k),
                    load_mat3(v_factors_at, k), first ? v_opacities_at[k] : 0.f);
  if (first && !seen[i]) {
    seen[i] = 1;
    store3(v_means, i, v.mean);
    v_means_t[i] = v.mean_t;
    vstore4(v.quat, i, v_quats);
    vstore4(v.log_scales, i, v_log_scales);
    v_logit_opacities[i] = v.logit_opacity;
    if (i >= moving) return;
    store3(v_velocities, i, v.velocity);
    store3(v_half_accelerations, i, v.half_acceleration);
    vstore4(v.turn, i, v_turns);
    return;
  }
  add3(v_means, i, v.mean);
  v_means_t[i] += v.mean_t;
  add4(v_quats, i, v.quat);
  add4(v_log_scales, i, v.log_scales);
  v_logit_opacities[i] += v.logit_opacity;
  if (i >= moving) return;
  add3(v_velocities, i, v.velocity);
  add3(v_half_accelerations, i, v.half_acceleration);
  add4(v_turns, i, v.turn);
}

// Makes the two children of a Gaussian, as native4d_split: in time, each on the parent's path, if
// it travels far in its lifetime; else in space.
kernel void spacetime_split(const uint n, const uint moving, const uint seed,
                            const float split_scale, const float split_travel,
                            const float min_lifetime, const float duration,
                            global const uint* restrict child, global float* restrict means,
                            global float* restrict means_t, global float* restrict velocities,
                            global const float* restrict half_accelerations,
                            global float* restrict quats, global const float* restrict turns,
                            global float* restrict log_scales,
                            global float* restrict logit_opacities) {
  const uint i = get_global_id(0);
  if (i >= n || child[i] == 0) return;
  const Spacetime g = load_spacetime(i, moving, SPACETIME_ROWS);
  const real4 sizes = exp(g.log_scales);
  const real3 s = sizes.xyz;
  const float life = sizes.w, longest = fmax(s.x, fmax(s.y, s.z));
  const int lasting = life > 0.5f * duration;  // its window is then [0, duration]
  const float window = lasting ? 0.5f * duration : life;
  const float travel = sqrt(dot(g.velocity, g.velocity)) * 2.f * window;
  if (i < moving && travel > split_travel * longest && 0.6f * window > min_lifetime) {
    const float centre = lasting ? 0.5f * duration : g.mean_t;
    const float t = centre + (child[i] == 1 ? -0.5f : 0.5f) * window, tau = t - g.mean_t;
    store3(means, i, spacetime_at(g, t).mean);
    means_t[i] = t;
    store3(velocities, i, spacetime_velocity(g, tau));
    vstore4(g.quat + g.turn * tau, i, quats);
    log_scales[4 * i + 3] = log(0.6f * window);
    return;
  }
  const int large = longest > split_scale;
  if (large || child[i] == 2) {
    const Mat3 factor = factor_of(g.quat, s);
    const real2 n1 = random_normal2(seed, 0u, i), n2 = random_normal2(seed, 2u, i);
    const real3 draw = make_real3(n1.x, n1.y, n2.x);
    store3(means, i,
           g.mean + make_real3(dot(factor.r1, draw), dot(factor.r2, draw), dot(factor.r3, draw)));
  }
  if (large) {
    const real less = 0.470003629f;  // log 1.6
    vstore4(g.log_scales - make_real4(less, less, less, 0.f), i, log_scales);
  }
  logit_opacities[i] = half_opacity_logit(g.logit_opacity);
}

// Learning-rate scales. rate_scale: as native4d_rate_scale. rate_divisor: the time in which its
// motion matters, its temporal standard deviation, clamped to at least a time step of the video (a
// flow leads that far) and at most all of it.
kernel void spacetime_rate_scale(const uint n, const float duration, const float time_step,
                                 const float power, const float most,
                                 global const float* restrict log_scales,  // [N, 4]
                                 global float* restrict rate_scale,        // [N]
                                 global float* restrict rate_divisor) {    // [N]
  const uint i = get_global_id(0);
  if (i >= n) return;
  const float life = exp(log_scales[4 * i + 3]);
  rate_scale[i] = lifetime_rate_scale(life, duration, power, most);
  rate_divisor[i] = clamp(life, time_step, duration);
}
