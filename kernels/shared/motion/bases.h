// SPDX-License-Identifier: Apache-2.0
// Rigid motions (bases) shared by all Gaussians and blended with per-Gaussian weights (as Shape of
// Motion, Wang et al. 2024, with pivots added). At a given time, basis b rotates by the unit
// quaternion q_b about its pivot c_b and shifts by s_b. The weights a are a softmax over
// (0, logits); the first entry, 0, stands for no motion.
//   mean   m + sum_b a_b (R(q_b) (m - c_b) + c_b + s_b - m)
//   quat   (1 + sum_b a_b (q_b - 1)) quat
// A single weight of 1 gives exactly that rigid motion.
#ifndef GFLOW_BASES_H
#define GFLOW_BASES_H
#include "shared/motion/shifted.h"

#define MAX_BASES 32

typedef struct BasisPose {
  real4 quat;  // unit
  real3 shift, pivot;
} BasisPose;

// Softmax over (0, logits); the weight of the 0 is not stored.
static inline void basis_weights(int bases, const real* logits, real* weights) {
  real most = 0, sum;
  for (int b = 0; b < bases; ++b) most = fmax(most, logits[b]);
  sum = exp(-most);
  for (int b = 0; b < bases; ++b) sum += weights[b] = exp(logits[b] - most);
  for (int b = 0; b < bases; ++b) weights[b] /= sum;
}

static inline real3 mat3_times(Mat3 r, real3 x) {
  return make_real3(dot(r.r1, x), dot(r.r2, x), dot(r.r3, x));
}
static inline real3 mat3_transposed_times(Mat3 r, real3 x) {
  return r.r1 * x.x + r.r2 * x.y + r.r3 * x.z;
}

// Displacement of the point m by a basis.
static inline real3 basis_shift(BasisPose p, real3 m) {
  return mat3_times(quat_to_rotmat(p.quat), m - p.pivot) + p.pivot + p.shift - m;
}
static inline real4 basis_turn(BasisPose p) {
  return p.quat - make_real4((real)1, (real)0, (real)0, (real)0);
}

// Applies the blend: `shift` is sum_b a_b basis_shift, `turn` is sum_b a_b basis_turn.
static inline Canonical blended(Canonical g, real3 shift, real4 turn) {
  g.mean = g.mean + shift;
  g.quat = quat_mul(turn + make_real4((real)1, (real)0, (real)0, (real)0), g.quat);
  return g;
}

// Gradient with respect to one basis' pose, given that with respect to the moved mean and the
// blended turn. The pivot's is 0.
static inline BasisPose basis_pose_vjp(BasisPose p, real weight, real3 m, real3 v_mean,
                                       real4 v_turn) {
  const real3 arm = m - p.pivot, v = v_mean * weight;
  Mat3 v_r;
  v_r.r1 = arm * v.x;
  v_r.r2 = arm * v.y;
  v_r.r3 = arm * v.z;
  BasisPose o;
  o.quat = quat_to_rotmat_vjp(p.quat, v_r) + v_turn * weight;
  o.shift = v;
  o.pivot = make_real3((real)0, (real)0, (real)0);
  return o;
}

#endif
