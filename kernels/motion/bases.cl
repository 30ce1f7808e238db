// SPDX-License-Identifier: Apache-2.0
// The bases motion model on the device (formulas: shared/motion/bases.h): the poses of the bases at
// a time, Gaussians that follow them, and the gradient. Windows, first and second time are as in
// native4d.cl. Gradients of the poses are summed over chunks of Gaussians, then over chunks in
// order: bitwise repeatable.
#include "shared/motion/bases.h"
#include "shared/motion/canonical_rows.h"
#include "shared/motion/culling.h"
#include "shared/motion/keys.h"
#include "shared/unrolled.h"

#define POSE 7  // floats per pose: unit quaternion, shift

// Not normalised. Row k B + b of the tables is key k of basis b; 0 is no motion.
static inline real4 basis_quat(int bases, int b, KeyWeights keys, global const float* basis_turns) {
  real4 q = make_real4(1.f, 0.f, 0.f, 0.f);
  FOR_UNROLLED(k, 0, KEYS_AT_ONCE, keys.count) {
    q += load4(basis_turns, (keys.first + k) * bases + b) * keys.weight[k];
  }
  return q;
}

// One work-item per basis.
kernel void bases_pose(const int bases, const KeyWeights keys,
                       global const float* restrict basis_shifts,  // [K, B, 3]
                       global const float* restrict basis_turns,   // [K, B, 4]
                       global float* restrict poses) {             // [B, POSE]
  const int b = get_global_id(0);
  if (b >= bases) return;
  real3 shift = make_real3(0.f, 0.f, 0.f);
  FOR_UNROLLED(k, 0, KEYS_AT_ONCE, keys.count) {
    shift += load3(basis_shifts, (keys.first + k) * bases + b) * keys.weight[k];
  }
  const real4 q = quat_normalize(basis_quat(bases, b, keys, basis_turns)).q;
  global float* o = poses + POSE * b;
  vstore4(q, 0, o);
  store3(o + 4, 0, shift);
}

static inline BasisPose load_pose(int b, global const float* poses, global const float* pivots) {
  BasisPose p;
  p.quat = vload4(0, poses + POSE * b);
  p.shift = load3(poses + POSE * b + 4, 0);
  p.pivot = load3(pivots, b);
  return p;
}

// Applies the bases to Gaussian i, one of the M dynamic ones. `weights` gets its blend weights.
static inline Canonical follow(uint i, Canonical g, int bases, global const float* basis_logits,
                               global const float* poses, global const float* pivots,
                               float* weights) {
  float logits[MAX_BASES];
  for (int b = 0; b < bases; ++b) logits[b] = basis_logits[i * bases + b];
  basis_weights(bases, logits, weights);
  real3 shift = make_real3(0.f, 0.f, 0.f);
  real4 turn = make_real4(0.f, 0.f, 0.f, 0.f);
  for (int b = 0; b < bases; ++b) {
    const BasisPose p = load_pose(b, poses, pivots);
    shift += basis_shift(p, g.mean) * weights[b];
    turn += basis_turn(p) * weights[b];
  }
  return blended(g, shift, turn);
}

kernel void bases_fwd(const uint n, const uint moving, const int bases, const float t,
                      const float sigmas, const int first, global const uint* restrict rows,
                      global const uint* restrict tiles_touched,  // [n] read if not first
                      CANONICAL_IN, global const float* restrict basis_logits,  // [M, B]
                      global const float* restrict poses,                       // [B, POSE]
                      global const float* restrict pivots,                      // [B, 3]
                      global float* restrict means_at,                          // [n, 3]
                      global float* restrict factors_at,                        // [n, 3, 3]
                      global float* restrict opacities_at) {                    // [n]
  const uint k = get_global_id(0);
  if (k >= n) return;
  const uint i = view_row(k, rows);
  if (!canonical_in_window(i, k, t, sigmas, first, tiles_touched, means_t, log_scales,
                           opacities_at))
    return;
  float weights[MAX_BASES];
  Canonical g = load_canonical(i, CANONICAL_ROWS);
  if (i < moving) g = follow(i, g, bases, basis_logits, poses, pivots, weights);
  store_shifted(k, shifted_at(g, no_shift(), t), means_at, factors_at, opacities_at);
}

// Culls rows that a camera cannot see at time t, as spacetime_cull (spacetime.cl). The means are
// moved for LANES Gaussians at once, too, since that is most of the work. cull_exp() is off by
// 1e-6 for logits within 10; PoCL would take a vector exp() apart into scalars.
kernel void bases_cull(const uint n, const uint moving, const int bases, const float t,
                       const float sigmas, const PinholeCamera camera, CANONICAL_IN,
                       global const float* restrict basis_logits,
                       global const float* restrict poses, global const float* restrict pivots,
                       global uint* restrict marks,     // [ceil(N / LANES)]
                       global uint* restrict counts) {  // [ceil(N / LANES)] their bits
  const uint group = get_global_id(0), first = group * LANES;
  if (first >= n) return;
  CullInputs culling;
  LaneInts shown;
  shown.all = cull_time(&culling, first, n, t, sigmas, means_t, log_scales);
  if (!lane_any(shown.all)) {
    cull_mark(group, n, shown, marks, counts);
    return;
  }
  cull_clear(&culling);
  LaneFloats logits[MAX_BASES];
  for (int b = 0; b < bases; ++b) logits[b].all = TO_LANE(-1e30f);  // static ones: weight 0
  for (uint i = first, r = 0; i < n && r < LANES; ++i, ++r) {
    cull_put(&culling, r, load3(means, i), vload4(i, log_scales), logit_opacities[i]);
    if (i >= moving) continue;
    for (int b = 0; b < bases; ++b) logits[b].row[r] = basis_logits[i * bases + b];
  }
  lane most = TO_LANE(0.f), x = most, y = most, z = most;  // the shift, times `sum`
  for (int b = 0; b < bases; ++b) most = fmax(most, logits[b].all);
  lane sum = cull_exp(-most);
  const lane mx = culling.x.all, my = culling.y.all, mz = culling.z.all;
  for (int b = 0; b < bases; ++b) {
    const BasisPose p = load_pose(b, poses, pivots);
    const Mat3 r = quat_to_rotmat(p.quat);
    const lane weight = cull_exp(logits[b].all - most);
    const lane ax = mx - p.pivot.x, ay = my - p.pivot.y, az = mz - p.pivot.z;
    sum += weight;
    x += weight * (r.r1.x * ax + r.r1.y * ay + r.r1.z * az + p.pivot.x + p.shift.x - mx);
    y += weight * (r.r2.x * ax + r.r2.y * ay + r.r2.z * az + p.pivot.y + p.shift.y - my);
    z += weight * (r.r3.x * ax + r.r3.y * ay + r.r3.z * az + p.pivot.z + p.shift.z - mz);
  }
  culling.x.all += x / sum;
  culling.y.all += y / sum;
  culling.z.all += z / sum;
  shown.all &= cull_visible(culling, camera);
  cull_mark(group, n, shown, marks, counts);
}

// One work-item per chunk of `length` entries of the view.
kernel void bases_bwd(const uint n, const uint moving, const uint length, const int bases,
                      const float t, const int first, global const uint* restrict rows,
                      CANONICAL_IN, global const float* restrict basis_logits,
                      global const float* restrict poses, global const float* restrict pivots,
                      global const uint* restrict tiles_touched,    // [n]
                      global const float* restrict v_means_at,      // [n, 3]
                      global const float* restrict v_factors_at,    // [n, 3, 3]
                      global const float* restrict v_opacities_at,  // [n] read if first
                      global uint* restrict seen, V_CANONICAL_OUT,
                      global float* restrict v_basis_logits,  // [M, B]
                      global float* restrict partials) {      // [chunks, B, POSE]
  const uint chunk = get_global_id(0), begin = chunk * length, end = min(n, begin + length);
  if (begin >= n) return;
  float sums[MAX_BASES * POSE];
  for (int k = 0; k < bases * POSE; ++k) sums[k] = 0.f;
  for (uint entry = begin; entry < end; ++entry) {
    if (tiles_touched[entry] == 0) continue;
    const uint i = view_row(entry, rows);
    float weights[MAX_BASES], v_weights[MAX_BASES];
    const Canonical canonical = load_canonical(i, CANONICAL_ROWS);
    const Canonical g =
        i < moving ? follow(i, canonical, bases, basis_logits, poses, pivots, weights) : canonical;
    Canonical v = shifted_vjp(g, no_shift(), t, load3(v_means_at, entry),
                              load_mat3(v_factors_at, entry), first ? v_opacities_at[entry] : 0.f);
    const int fresh = first && !seen[i];
    if (fresh) seen[i] = 1;
    if (i >= moving) {
      put_canonical(i, v, fresh, V_CANONICAL_ROWS);
      continue;
    }
    // g.quat = blend * canonical.quat
    const real4 v_turn = quat_mul(v.quat, quat_conj(canonical.quat)), v_quat = v.quat;
    const real3 v_mean = v.mean;
    real4 blend = make_real4(1.f, 0.f, 0.f, 0.f);
    float mean_v = 0.f;  // weighted mean of v_weights
    for (int b = 0; b < bases; ++b) {
      const BasisPose p = load_pose(b, poses, pivots);
      const BasisPose v_p = basis_pose_vjp(p, weights[b], canonical.mean, v_mean, v_turn);
      const Mat3 r = quat_to_rotmat(p.quat);
      v.mean += (mat3_transposed_times(r, v_mean) - v_mean) * weights[b];
      blend += basis_turn(p) * weights[b];
      v_weights[b] = dot(v_mean, basis_shift(p, canonical.mean)) + dot(v_turn, basis_turn(p));
      mean_v += weights[b] * v_weights[b];
      float* sum = sums + POSE * b;
      // A broken Gaussian keeps its non-finite gradient, but must not affect the shared bases.
      const float told = v_p.quat.x + v_p.quat.y + v_p.quat.z + v_p.quat.w + v_p.shift.x +
                         v_p.shift.y + v_p.shift.z;
      if (!is_finite_real(told)) continue;
      sum[0] += v_p.quat.x, sum[1] += v_p.quat.y, sum[2] += v_p.quat.z, sum[3] += v_p.quat.w;
      sum[4] += v_p.shift.x, sum[5] += v_p.shift.y, sum[6] += v_p.shift.z;
    }
    v.quat = quat_mul(quat_conj(blend), v_quat);
    put_canonical(i, v, fresh, V_CANONICAL_ROWS);
    for (int b = 0; b < bases; ++b) {
      const float v_logit = weights[b] * (v_weights[b] - mean_v);
      global float* o = v_basis_logits + i * bases + b;
      *o = fresh ? v_logit : *o + v_logit;
    }
  }
  for (int k = 0; k < bases * POSE; ++k) partials[chunk * bases * POSE + k] = sums[k];
}

// One work-item per basis: sums its chunks and passes the gradient on to the keys of its pose.
kernel void bases_gather(const uint chunks, const int bases, const KeyWeights keys,
                         global const float* restrict basis_turns,
                         global const float* restrict partials,
                         global uint* restrict keys_seen,  // [K, B]
                         global float* restrict v_basis_shifts,
                         global float* restrict v_basis_turns) {
  const int b = get_global_id(0);
  if (b >= bases) return;
  real4 v_unit = make_real4(0.f, 0.f, 0.f, 0.f);
  real3 v_shift = make_real3(0.f, 0.f, 0.f);
  for (uint c = 0; c < chunks; ++c) {
    global const float* p = partials + (c * bases + b) * POSE;
    v_unit += vload4(0, p);
    v_shift += load3(p + 4, 0);
  }
  const real4 v_quat =
      quat_normalize_vjp(quat_normalize(basis_quat(bases, b, keys, basis_turns)), v_unit);
  FOR_UNROLLED(k, 0, KEYS_AT_ONCE, keys.count) {
    const float w = keys.weight[k];
    const uint row = (keys.first + k) * bases + b;
    if (w == 0.f) continue;
    if (keys_seen[row]) {
      add3(v_basis_shifts, row, v_shift * w);
      add4(v_basis_turns, row, v_quat * w);
    } else {
      keys_seen[row] = 1;
      store3(v_basis_shifts, row, v_shift * w);
      vstore4(v_quat * w, row, v_basis_turns);
    }
  }
}
