// SPDX-License-Identifier: Apache-2.0
// The static/dynamic split: which Gaussians need no motion, their static pose, and which static
// ones become dynamic again. One work-item per Gaussian; bitwise repeatable.
#include "shared/arrays.h"
#include "shared/static_detection.h"
#include "shared/view_rows.h"

// Adds the pose of dynamic Gaussians (rows < moving) at one time to their mean, weighted by
// opacity.
kernel void static_add(const uint moving, global const float* restrict means_at,
                       global const float* restrict factors_at,
                       global const float* restrict opacities_at,  // 0: not visible then
                       global float* restrict means,               // [M, 3] sums
                       global float* restrict factors,             // [M, 3, 3] sums
                       global float* restrict weights,             // [M] sums
                       global uint* restrict moments) {            // [M] number of times
  const uint i = get_global_id(0);
  if (i >= moving) return;
  const float w = opacities_at[i];
  if (!(w > 0.f)) return;
  add3(means, i, load3(means_at, i) * w);
  store_mat3(factors, i, mat3_add(load_mat3(factors, i), mat3_scale(load_mat3(factors_at, i), w)));
  weights[i] += w;
  moments[i] += 1;
}

static inline float3 scales_of(uint i, global const float* log_scales) {
  return make_real3(exp(log_scales[4 * i]), exp(log_scales[4 * i + 1]), exp(log_scales[4 * i + 2]));
}

// Turns the sums into a pose: the mean position and the rotation of the mean factor.
kernel void static_pose_of(const uint moving, global const float* restrict log_scales,  // [N, 4]
                           global const float* restrict factors,
                           global const float* restrict weights,
                           global float* restrict means,    // [M, 3]
                           global float* restrict quats) {  // [M, 4]
  const uint i = get_global_id(0);
  if (i >= moving || !(weights[i] > 0.f)) return;
  const float inverse = 1.f / weights[i];
  const float3 s = scales_of(i, log_scales);
  Mat3 r = mat3_scale(load_mat3(factors, i), inverse);
  const float3 columns = make_real3(1.f / s.x, 1.f / s.y, 1.f / s.z);
  r.r1 *= columns;
  r.r2 *= columns;
  r.r3 *= columns;
  store3(means, i, load3(means, i) * inverse);
  vstore4(quat_of_rotmat(r), i, quats);
}

// Distance of each Gaussian from that pose at one time; NaN counts as infinite.
kernel void static_travel(const uint moving, global const float* restrict log_scales,  // [N, 4]
                          global const float* restrict means, global const float* restrict quats,
                          global const float* restrict means_at,
                          global const float* restrict factors_at,
                          global const float* restrict opacities_at,
                          global float* restrict travel) {  // [M] largest so far
  const uint i = get_global_id(0);
  if (i >= moving || !(opacities_at[i] > 0.f)) return;
  const float d = distance_from_static(load3(means, i), load4(quats, i), scales_of(i, log_scales),
                                       load3(means_at, i), load_mat3(factors_at, i));
  travel[i] = d >= travel[i] ? d : (d == d ? travel[i] : INFINITY);
}

// Adds up the gradient that a view would give the velocities of static Gaussians (rows [moving, N),
// the rows of `gradient_sums`): x y z the sum of the gradients, w that of their squared norms. flow
// 0: none; 1: v_means includes the flow's part at t; 2: it does not (View::moving), and that part
// is minus the one at t2. Processes entries [first, n) of the view (shared/view_rows.h).
kernel void static_accumulate(const uint n, const uint first, const uint moving, const float t,
                              const float t2, const int flow, global const uint* restrict rows,
                              global const uint* restrict tiles_touched,  // [n]
                              global const float* restrict means_t,       // [N]
                              global const float* restrict v_means,       // [n, 3] at t
                              global const float* restrict v_means_t2,    // [n, 3] at t2 with flow
                              global float* restrict gradient_sums) {     // [N - M, 4]
  const uint k = first + get_global_id(0);
  if (k >= n || tiles_touched[k] == 0) return;
  const uint i = view_row(k, rows);
  float3 v = load3(v_means, k) * (t - means_t[i]);
  if (flow) v += load3(v_means_t2, k) * (t2 - (flow == 2 ? t : means_t[i]));
  const float square = dot(v, v);
  if (is_finite_real(square)) add4(gradient_sums, i - moving, (float4)(v.x, v.y, v.z, square));
}

// moves: 0 for Gaussians that are static from now on. A dynamic one becomes static if it made
// `trial` steps and, at two or more times, was never further than `most` from its mean pose. A
// static one becomes dynamic if the norm of its summed gradients exceeds `wake` times the square
// root of the summed squares, which is what noise would give; wake 0: never. Also sets source and
// child (1: optimiser state is reset) of each row, for RowMover.
kernel void static_decide(const uint n, const uint moving, const float most, const uint trial,
                          const float wake, global const float* restrict travel,
                          global const uint* restrict moments, global const uint* restrict steps,
                          global const float* restrict gradient_sums, global uint* restrict moves,
                          global uint* restrict source, global uint* restrict child) {
  const uint i = get_global_id(0);
  if (i >= n) return;
  source[i] = i;
  child[i] = 0;
  if (i >= moving) {
    const float4 p = vload4(i - moving, gradient_sums);
    moves[i] = child[i] = wake > 0.f && dot(p.xyz, p.xyz) > wake * wake * p.w;
    return;
  }
  moves[i] = !(steps[i] >= trial && moments[i] > 1 && travel[i] <= most);
}

// After the rows have moved: rows from `moving` on that were dynamic (source below old_moving) take
// their static pose. A quaternion keeps its length, on which its effective learning rate depends.
kernel void static_settle(const uint n, const uint moving, const uint old_moving,
                          global const uint* restrict source,
                          global const float* restrict static_means,  // [old_moving, 3]
                          global const float* restrict static_quats,  // [old_moving, 4]
                          global float* restrict means, global float* restrict quats) {
  const uint i = moving + get_global_id(0);
  if (i >= n || source[i] >= old_moving) return;
  const float4 q = vload4(i, quats);
  store3(means, i, load3(static_means, source[i]));
  vstore4(vload4(source[i], static_quats) * sqrt(dot(q, q)), i, quats);
}
