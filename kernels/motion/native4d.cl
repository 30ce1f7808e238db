// SPDX-License-Identifier: Apache-2.0
// The native4d motion model on the device (formulas: shared/motion/native4d.h): 4D Gaussians sliced
// at time t, and the gradient. The time window is applied before projection: a Gaussian whose
// temporal weight is at most `cutoff` gets opacity 0 and no further work. One work-item per
// Gaussian.
#include "shared/arrays.h"
#include "shared/motion/culling.h"
#include "shared/motion/native4d.h"
#include "shared/random.h"
#include "shared/view_rows.h"

// Gaussians from `moving` on are static: they have no row of quats_r and use quats instead.
static inline Native4d load_native4d(uint i, uint moving, global const float* means,
                                     global const float* means_t, global const float* quats,
                                     global const float* quats_r, global const float* log_scales,
                                     global const float* logit_opacities) {
  Native4d g;
  g.mean = load3(means, i);
  g.mean_t = means_t[i];
  g.quat = load4(quats, i);
  g.quat_r = i < moving ? load4(quats_r, i) : g.quat;
  g.log_scales = load4(log_scales, i);
  g.logit_opacity = logit_opacities[i];
  return g;
}

// Poses of a view. At its first time (first = 1), Gaussians outside their time window get opacity 0
// and nothing else is written for them. At a second time (first = 0), only rows with tiles_touched
// > 0 are written, whether inside their window or not, since a Gaussian visible at t1 also moves
// while it fades; their opacities are not. tiles_touched and the outputs have one entry per row of
// the view (shared/view_rows.h).
kernel void native4d_fwd(const uint n, const uint moving, const float t, const float cutoff,
                         const int first, global const uint* restrict rows,
                         global const uint* restrict tiles_touched,     // [n] read if not first
                         global const float* restrict means,            // [N, 3]
                         global const float* restrict means_t,          // [N]
                         global const float* restrict quats,            // [N, 4] ql
                         global const float* restrict quats_r,          // [N, 4] qr
                         global const float* restrict log_scales,       // [N, 4] x y z t
                         global const float* restrict logit_opacities,  // [N]
                         global float* restrict means_at,               // [n, 3]
                         global float* restrict factors_at,             // [n, 3, 3]
                         global float* restrict opacities_at) {         // [n]
  const uint k = get_global_id(0);
  if (k >= n || (!first && tiles_touched[k] == 0)) return;
  const uint i = view_row(k, rows);
  const Native4d g =
      load_native4d(i, moving, means, means_t, quats, quats_r, log_scales, logit_opacities);
  if (first && !(marginal_at(g, t) > cutoff)) {
    opacities_at[k] = 0.f;
    return;
  }
  const Slice s = slice_at(g, t);
  if (first) opacities_at[k] = s.life.opacity;
  store3(means_at, k, s.mean);
  store_mat3(factors_at, k, s.factor);
}

// LANES quaternions t + xi + yj + zk.
typedef struct LaneQuat {
  lane t, x, y, z;
} LaneQuat;
static inline LaneQuat lane_quat(lane t, lane x, lane y, lane z) {
  LaneQuat q;
  q.t = t, q.x = x, q.y = y, q.z = z;
  return q;
}
static inline LaneQuat lane_quat_mul(LaneQuat a, LaneQuat b) {
  return lane_quat(
      a.t * b.t - a.x * b.x - a.y * b.y - a.z * b.z, a.t * b.x + a.x * b.t + a.y * b.z - a.z * b.y,
      a.t * b.y - a.x * b.z + a.y * b.t + a.z * b.x, a.t * b.z + a.x * b.y - a.y * b.x + a.z * b.t);
}
static inline LaneQuat lane_quat_scale(LaneQuat q, lane s) {
  return lane_quat(q.t * s, q.x * s, q.y * s, q.z * s);
}
static inline lane lane_quat_norm2(LaneQuat q) {
  return q.t * q.t + q.x * q.x + q.y * q.y + q.z * q.z;
}
// Whether this squared length is finite and no special case of quat_normalize (shared/quat.h).
static inline lane_int lane_quat_sound(lane norm2) {
  return (norm2 > TO_LANE(1e-11f)) & (norm2 < TO_LANE(1e36f));
}

// Culls rows that a camera cannot see at time t, as spacetime_cull (spacetime.cl). An upper bound
// of the longest axis is the square root of the trace of the slice's covariance,
//   tr(P_space P_space^T - velocity velocity^T |p_t|^2) = sum over columns |space - velocity t|^2.
kernel void native4d_cull(const uint n, const uint moving, const float t, const float cutoff,
                          const PinholeCamera camera, global const float* restrict means,
                          global const float* restrict means_t, global const float* restrict quats,
                          global const float* restrict quats_r,
                          global const float* restrict log_scales,
                          global const float* restrict logit_opacities,
                          global uint* restrict marks,     // [ceil(N / LANES)]
                          global uint* restrict counts) {  // [ceil(N / LANES)] their bits
  const uint group = get_global_id(0), first = group * LANES;
  if (first >= n) return;
  // The temporal standard deviation is at most the longest scale, whatever the rotation.
  const lane since = t - cull_column(means_t, first, n, 1, 0);
  lane log_longest = cull_column(log_scales, first, n, 4, 0);
  for (uint axis = 1; axis < 4; ++axis)
    log_longest = fmax(log_longest, cull_column(log_scales, first, n, 4, axis));
  LaneInts shown;
  shown.all = cull_in_time_window(since, log_longest, sqrt(-2.f * log(cutoff)));
  if (!lane_any(shown.all)) {
    cull_mark(group, n, shown, marks, counts);
    return;
  }
  // mean 0 to 2, t - mean_t 3, ql 4 to 7, qr 8 to 11, log scales 12 to 15, logit 16
  LaneFloats in[17];
  for (int k = 0; k < 17; ++k) in[k].all = TO_LANE(0.f);
  for (uint i = first, r = 0; i < n && r < LANES; ++i, ++r) {
    const Native4d g =
        load_native4d(i, moving, means, means_t, quats, quats_r, log_scales, logit_opacities);
    in[0].row[r] = g.mean.x, in[1].row[r] = g.mean.y, in[2].row[r] = g.mean.z;
    in[3].row[r] = t - g.mean_t;
    in[4].row[r] = g.quat.x, in[5].row[r] = g.quat.y, in[6].row[r] = g.quat.z;
    in[7].row[r] = g.quat.w;
    in[8].row[r] = g.quat_r.x, in[9].row[r] = g.quat_r.y, in[10].row[r] = g.quat_r.z;
    in[11].row[r] = g.quat_r.w;
    in[12].row[r] = g.log_scales.x, in[13].row[r] = g.log_scales.y;
    in[14].row[r] = g.log_scales.z, in[15].row[r] = g.log_scales.w;
    in[16].row[r] = g.logit_opacity;
  }
  const LaneQuat ql = lane_quat(in[4].all, in[5].all, in[6].all, in[7].all);
  const LaneQuat qr_conj = lane_quat(in[8].all, -in[9].all, -in[10].all, -in[11].all);
  const lane l2 = lane_quat_norm2(ql), r2 = lane_quat_norm2(qr_conj);
  const LaneQuat l = lane_quat_scale(ql, 1.f / sqrt(l2));
  const LaneQuat back = lane_quat_scale(qr_conj, 1.f / sqrt(r2));
  const LaneQuat axes[4] = {lane_quat(-l.x, l.t, l.z, -l.y), lane_quat(-l.y, -l.z, l.t, l.x),
                            lane_quat(-l.z, l.y, -l.x, l.t), l};  // ql e_k
  LaneQuat p[4];                                                  // the columns of P
  for (int k = 0; k < 4; ++k)
    p[k] = lane_quat_scale(lane_quat_mul(axes[k], back), cull_exp(in[12 + k].all));
  lane tt = TO_LANE(0.f), xt = tt, yt = tt, zt = tt, all = tt, size = tt;  // sums over the columns
  for (int k = 0; k < 4; ++k) {
    tt += p[k].t * p[k].t;
    xt += p[k].x * p[k].t;
    yt += p[k].y * p[k].t;
    zt += p[k].z * p[k].t;
    all += p[k].x * p[k].x + p[k].y * p[k].y + p[k].z * p[k].z;
  }
  const lane vx = xt / tt, vy = yt / tt, vz = zt / tt;
  for (int k = 0; k < 4; ++k) {
    const lane x = p[k].x - vx * p[k].t, y = p[k].y - vy * p[k].t, z = p[k].z - vz * p[k].t;
    size += x * x + y * y + z * z;
  }
  const lane dt = in[3].all, there = cull_exp(-0.5f * dt * dt / tt);
  const lane opacity = there / (TO_LANE(1.f) + cull_exp(-in[16].all));
  shown.all = !(there <= TO_LANE(0.999f * cutoff)) &
              may_be_seen(camera, fma(vx, dt, in[0].all), fma(vy, dt, in[1].all),
                          fma(vz, dt, in[2].all), sqrt(size) + 1e-6f * sqrt(all), opacity);
  shown.all |= !(lane_quat_sound(l2) & lane_quat_sound(r2));
  cull_mark(group, n, shown, marks, counts);
}

// Gradients of the Gaussians visible in this view; other rows are unchanged. The call for t1 (first
// = 1) sets the gradients of Gaussians not yet `seen` in this training step and marks them;
// otherwise gradients are added. v_opacities_at is read only if first = 1, since t2 does not affect
// opacities.
kernel void native4d_bwd(const uint n, const uint moving, const float t, const int first,
                         global const uint* restrict rows, global const float* restrict means,
                         global const float* restrict means_t, global const float* restrict quats,
                         global const float* restrict quats_r,
                         global const float* restrict log_scales,
                         global const float* restrict logit_opacities,
                         global const uint* restrict tiles_touched,    // [n]
                         global const float* restrict v_means_at,      // [n, 3]
                         global const float* restrict v_factors_at,    // [n, 3, 3]
                         global const float* restrict v_opacities_at,  // [n]
                         global uint* restrict seen,                   // [N]
                         global float* restrict v_means, global float* restrict v_means_t,
                         global float* restrict v_quats, global float* restrict v_quats_r,
                         global float* restrict v_log_scales,
                         global float* restrict v_logit_opacities) {
  const uint k = get_global_id(0);
  if (k >= n || tiles_touched[k] == 0) return;
  const uint i = view_row(k, rows);
  const Native4d g =
      load_native4d(i, moving, means, means_t, quats, quats_r, log_scales, logit_opacities);
  Native4d v = slice_vjp(g, t, load3(v_means_at, k), load_mat3(v_factors_at, k),
                         first ? v_opacities_at[k] : 0.f);
  if (i >= moving) v.quat += v.quat_r;
  if (first && !seen[i]) {
    seen[i] = 1;
    store3(v_means, i, v.mean);
    v_means_t[i] = v.mean_t;
    vstore4(v.quat, i, v_quats);
    if (i < moving) vstore4(v.quat_r, i, v_quats_r);
    vstore4(v.log_scales, i, v_log_scales);
    v_logit_opacities[i] = v.logit_opacity;
    return;
  }
  add3(v_means, i, v.mean);
  v_means_t[i] += v.mean_t;
  add4(v_quats, i, v.quat);
  if (i < moving) add4(v_quats_r, i, v.quat_r);
  add4(v_log_scales, i, v.log_scales);
  v_logit_opacities[i] += v.logit_opacity;
}

// Makes the two children of a Gaussian (child 1 and 2; rows with 0 are unchanged):
//   if it travels further than split_travel x its longest axis while visible: split in time, one
//     child for each half of its lifetime, both on the parent's path;
//   else if it is larger than split_scale: both are drawn from it and 1.6 times smaller;
//   else it is cloned: child 2 is drawn from it.
kernel void native4d_split(const uint n, const uint moving, const uint seed,
                           const float split_scale, const float split_travel,
                           const float min_lifetime, const float duration,
                           global const uint* restrict child, global float* restrict means,
                           global float* restrict means_t, global const float* restrict quats,
                           global const float* restrict quats_r, global float* restrict log_scales,
                           global float* restrict logit_opacities) {
  const uint i = get_global_id(0);
  if (i >= n || child[i] == 0) return;
  const Native4d g =
      load_native4d(i, moving, means, means_t, quats, quats_r, log_scales, logit_opacities);
  const real4 s = exp(g.log_scales);
  const Rows4 p = rows_of(frame4(quat_normalize(g.quat).q, quat_normalize(g.quat_r).q), s);
  const Slice o = slice_rows(g, p, g.mean_t);
  const float longest = fmax(s.x, fmax(s.y, s.z));

  const int lasting = o.norm_t > 0.5f * duration;  // its window is then [0, duration]
  const float window = lasting ? 0.5f * duration : o.norm_t;
  const float travel = sqrt(dot(o.velocity, o.velocity)) * 2.f * window;
  if (travel > split_travel * longest && 0.6f * window > min_lifetime) {
    const float centre = lasting ? 0.5f * duration : g.mean_t;
    const float t = centre + (child[i] == 1 ? -0.5f : 0.5f) * window;
    store3(means, i, g.mean + o.velocity * (t - g.mean_t));
    means_t[i] = t;
    log_scales[4 * i + 3] = g.log_scales.w + log(0.6f * window / o.norm_t);
    return;
  }
  const int large = longest > split_scale;
  if (large || child[i] == 2) {
    const real2 n1 = random_normal2(seed, 0u, i), n2 = random_normal2(seed, 2u, i);
    const real3 draw = make_real3(n1.x, n1.y, n2.x);
    store3(means, i,
           g.mean +
               make_real3(dot(o.factor.r1, draw), dot(o.factor.r2, draw), dot(o.factor.r3, draw)));
  }
  if (large) {
    const real less = 0.470003629f;  // log 1.6
    vstore4(g.log_scales - make_real4(less, less, less, 0.f), i, log_scales);
  }
  logit_opacities[i] = half_opacity_logit(g.logit_opacity);
}

// Learning-rate scale of each Gaussian (lifetime_rate_scale).
kernel void native4d_rate_scale(const uint n, const float duration, const float power,
                                const float most,
                                global const float* restrict log_scales,  // [N, 4]
                                global float* restrict rate_scale) {      // [N]
  const uint i = get_global_id(0);
  if (i >= n) return;
  rate_scale[i] = lifetime_rate_scale(exp(log_scales[4 * i + 3]), duration, power, most);
}
