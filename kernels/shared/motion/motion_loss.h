// SPDX-License-Identifier: Apache-2.0
// Motion regularisers between two times t1 and t2 (Dynamic 3D Gaussians, Luiten et al. 2024, eqs. 6
// to 10; here for each pair {i, j} of neighbours, symmetrically). With the means m, d = m_j - m_i,
// T the rotation from t2 back to t1, l the reference distance and
// rho(r) = sqrt(|r|^2 + knee^2) - knee:
//   rigidity   (rho(d1 - T_i d2) + rho(d1 - T_j d2)) / 2   d rotates with both Gaussians
//   rotation   rho(T_i - T_j), over all nine elements      both rotate alike
//   isometry   (rho(|d1| - l) + rho(|d2| - l)) / 2         their distance is kept
//   velocity   rho(d2 - d1)                                both move alike
// For one Gaussian at three evenly spaced times: acceleration rho(m0 - 2 m1 + m2).
#ifndef GFLOW_MOTION_LOSS_H
#define GFLOW_MOTION_LOSS_H
#include "shared/linear.h"

// Weights of the terms, per pair or per Gaussian; 0: not computed. Passed by value from the host.
typedef struct MotionLossRule {
  float rigidity, rotation, isometry, velocity, acceleration;
  float knee;  // of rho for lengths [scene units]
} MotionLossRule;

#define ROTATION_KNEE 0.01f  // of rho for rotation matrices, no unit: 0.4 degrees

// The axes of a factor L = R diag(s): its columns at length 1, stored as rows.
typedef struct Axes {
  Mat3 unit;
  real3 inverse_length;  // all 0 if a column is too short, too long or non-finite
} Axes;
static inline Axes axes_of(Mat3 factor) {
  const Mat3 columns = mat3_transpose(factor);
  const real least = (real)1e-15f, most = (real)1e15f;  // their squares are floats
  Axes a;
  const real l1 = sqrt(dot(columns.r1, columns.r1)), l2 = sqrt(dot(columns.r2, columns.r2));
  const real l3 = sqrt(dot(columns.r3, columns.r3));
  a.unit = mat3_identity();
  a.inverse_length = make_real3((real)0, (real)0, (real)0);
  if (!(fmin(l1, fmin(l2, l3)) > least && l1 < most && l2 < most && l3 < most))
    return a;  // NaN too
  a.inverse_length = make_real3((real)1 / l1, (real)1 / l2, (real)1 / l3);
  a.unit.r1 = columns.r1 * a.inverse_length.x;
  a.unit.r2 = columns.r2 * a.inverse_length.y;
  a.unit.r3 = columns.r3 * a.inverse_length.z;
  return a;
}
// Gradient with respect to the factor, given that with respect to the unit axes.
static inline Mat3 axes_vjp(Axes a, Mat3 v) {
  Mat3 columns;
  columns.r1 = (v.r1 - a.unit.r1 * dot(a.unit.r1, v.r1)) * a.inverse_length.x;
  columns.r2 = (v.r2 - a.unit.r2 * dot(a.unit.r2, v.r2)) * a.inverse_length.y;
  columns.r3 = (v.r3 - a.unit.r3 * dot(a.unit.r3, v.r3)) * a.inverse_length.z;
  return mat3_transpose(columns);
}

// T = U1 inverse(U2), U having the unit axes as columns. For factors R diag(s) it is R1 R2^T,
// whatever the scales; for a factor that does not change it is I. Where axes are undefined or
// nearly coplanar, T is I and has no gradient.
typedef struct Turn {
  Axes axes1, axes2;
  Mat3 inverse2;  // inverse(U2)
  Mat3 t;
  int known;
} Turn;
static inline Turn relative_rotation(Mat3 factor1, Mat3 factor2) {
  Turn o;
  o.axes1 = axes_of(factor1);
  o.axes2 = axes_of(factor2);
  const Mat3 u = o.axes2.unit;
  const real det = dot(u.r1, cross(u.r2, u.r3));
  o.known = o.axes1.inverse_length.x > (real)0 && o.axes2.inverse_length.x > (real)0 &&
            fabs(det) > (real)0.05f;
  o.inverse2 = mat3_identity();
  o.t = o.inverse2;
  if (!o.known) return o;
  const real inverse = (real)1 / det;
  o.inverse2.r1 = cross(u.r2, u.r3) * inverse;
  o.inverse2.r2 = cross(u.r3, u.r1) * inverse;
  o.inverse2.r3 = cross(u.r1, u.r2) * inverse;
  o.t = mat3_mul(mat3_transpose(o.axes1.unit), o.inverse2);
  return o;
}
typedef struct TurnGradient {
  Mat3 factor1, factor2;
} TurnGradient;
static inline TurnGradient turn_vjp(Turn o, Mat3 v) {
  TurnGradient g;
  g.factor1 = g.factor2 = mat3_scale(mat3_identity(), (real)0);
  if (!o.known) return g;
  // v_U1 = v inverse(U2)^T, v_U2 = -T^T v_U1; transposed, as axes are rows here
  const Mat3 v_axes1 = mat3_mul(o.inverse2, mat3_transpose(v));
  const Mat3 v_axes2 = mat3_scale(mat3_mul(v_axes1, o.t), (real)-1);
  g.factor1 = axes_vjp(o.axes1, v_axes1);
  g.factor2 = axes_vjp(o.axes2, v_axes2);
  return g;
}

// rho, and 1 / sqrt(|r|^2 + knee^2), which times r is its gradient. Both are 0 where the square is
// NaN or above 1e30, so that a broken Gaussian does not affect its neighbours.
typedef struct Rho {
  real value, factor;
} Rho;
static inline Rho rho_of_square(real square, real knee) {
  Rho o;
  o.value = o.factor = (real)0;
  if (!(square < (real)1e30f)) return o;
  const real root = sqrt(square + knee * knee);
  o.value = square / (root + knee);
  o.factor = (real)1 / root;
  return o;
}

// One Gaussian of a pair, at both times.
typedef struct PairMember {
  real3 mean1, mean2;
  Mat3 turn;
} PairMember;

// One Gaussian's share of a pair's loss (of rigidity the term with its own rotation, of the other
// terms half), and the gradient of the pair's whole loss with respect to it.
typedef struct PairTerms {
  real rigidity, rotation, isometry, velocity;
} PairTerms;
typedef struct PairShare {
  PairTerms terms;
  PairMember gradient;
} PairShare;

static inline PairShare pair_share(MotionLossRule rule, real weight, real distance, PairMember i,
                                   PairMember j) {
  const real half_of = (real)0.5f;
  const real knee = rule.knee;
  const real3 d1 = j.mean1 - i.mean1, d2 = j.mean2 - i.mean2;
  PairShare o;
  o.terms.rigidity = o.terms.rotation = o.terms.isometry = o.terms.velocity = (real)0;
  o.gradient.mean1 = o.gradient.mean2 = make_real3((real)0, (real)0, (real)0);
  o.gradient.turn = mat3_scale(mat3_identity(), (real)0);
  if (rule.rigidity > 0.f) {
    const real w = half_of * weight * rule.rigidity;
    const real3 r_i = d1 - mat3_mul_vec(i.turn, d2), r_j = d1 - mat3_mul_vec(j.turn, d2);
    const Rho rho_i = rho_of_square(dot(r_i, r_i), knee),
              rho_j = rho_of_square(dot(r_j, r_j), knee);
    const real3 g_i = r_i * (w * rho_i.factor), g_j = r_j * (w * rho_j.factor);
    if (rho_i.factor > (real)0 && rho_j.factor > (real)0) {
      o.terms.rigidity = w * rho_i.value;
      o.gradient.mean1 = -(g_i + g_j);
      o.gradient.mean2 = mat3_transpose_mul_vec(i.turn, g_i) + mat3_transpose_mul_vec(j.turn, g_j);
      o.gradient.turn.r1 = d2 * -g_i.x;
      o.gradient.turn.r2 = d2 * -g_i.y;
      o.gradient.turn.r3 = d2 * -g_i.z;
    }
  }
  if (rule.rotation > 0.f) {
    const real w = weight * rule.rotation;
    const Mat3 r = mat3_add(i.turn, mat3_scale(j.turn, (real)-1));
    const Rho rho =
        rho_of_square(dot(r.r1, r.r1) + dot(r.r2, r.r2) + dot(r.r3, r.r3), (real)ROTATION_KNEE);
    o.terms.rotation = half_of * w * rho.value;
    if (rho.factor > (real)0)
      o.gradient.turn = mat3_add(o.gradient.turn, mat3_scale(r, w * rho.factor));
  }
  if (rule.isometry > 0.f) {
    const real w = half_of * weight * rule.isometry;
    const real l1 = sqrt(dot(d1, d1)), l2 = sqrt(dot(d2, d2));
    const real e1 = l1 - distance, e2 = l2 - distance;
    const Rho rho1 = rho_of_square(e1 * e1, knee), rho2 = rho_of_square(e2 * e2, knee);
    o.terms.isometry = half_of * w * (rho1.value + rho2.value);
    // the direction is undefined where the two coincide
    if (l1 > (real)0 && rho1.factor > (real)0)
      o.gradient.mean1 = o.gradient.mean1 - d1 * (w * rho1.factor * e1 / l1);
    if (l2 > (real)0 && rho2.factor > (real)0)
      o.gradient.mean2 = o.gradient.mean2 - d2 * (w * rho2.factor * e2 / l2);
  }
  if (rule.velocity > 0.f) {
    const real w = weight * rule.velocity;
    const real3 r = d2 - d1;
    const Rho rho = rho_of_square(dot(r, r), knee);
    o.terms.velocity = half_of * w * rho.value;
    if (rho.factor > (real)0) {
      const real3 g = r * (w * rho.factor);
      o.gradient.mean1 = o.gradient.mean1 + g;
      o.gradient.mean2 = o.gradient.mean2 - g;
    }
  }
  return o;
}

// The acceleration term. `gradient` is w.r.t. m0 and m2; the one w.r.t. m1 is -2 times that.
typedef struct Bend {
  real value;
  real3 gradient;
} Bend;
static inline Bend acceleration_loss(MotionLossRule rule, real3 m0, real3 m1, real3 m2) {
  const real3 r = m0 - m1 * (real)2 + m2;
  const Rho rho = rho_of_square(dot(r, r), rule.knee);
  Bend o;
  o.value = rule.acceleration * rho.value;
  o.gradient = make_real3((real)0, (real)0, (real)0);
  if (rho.factor > (real)0) o.gradient = r * (rule.acceleration * rho.factor);
  return o;
}

#endif
