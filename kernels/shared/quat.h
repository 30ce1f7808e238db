// SPDX-License-Identifier: Apache-2.0
// Quaternions (w, x, y, z), stored in a real4 in that order, and their derivatives.
#ifndef GFLOW_QUAT_H
#define GFLOW_QUAT_H
#include "shared/linear.h"

typedef struct UnitQuat {
  real4 q;
  real inverse_norm;  // 0 if the input was too short or non-finite
} UnitQuat;

// q/|q|. Divides by the largest component first, so that squares stay in float range (|q| = 2e19).
// A quaternion whose components are at most 1e-6, or non-finite, becomes the identity.
static inline UnitQuat quat_normalize(real4 q) {
  UnitQuat u;
  const real largest = fmax(fmax(fabs(q.x), fabs(q.y)), fmax(fabs(q.z), fabs(q.w)));
  u.q = make_real4((real)1, (real)0, (real)0, (real)0);
  u.inverse_norm = (real)0;
  if (!(largest > (real)1e-6f) || !is_finite_real(q.x + q.y + q.z + q.w)) return u;
  const real4 scaled = q * ((real)1 / largest);
  const real inverse = (real)1 / sqrt(dot(scaled, scaled));
  u.q = scaled * inverse;
  u.inverse_norm = inverse / largest;
  return u;
}
// d(q/|q|) = (I - u u^T) dq / |q|
static inline real4 quat_normalize_vjp(UnitQuat u, real4 v_unit) {
  return (v_unit - u.q * dot(u.q, v_unit)) * u.inverse_norm;
}

static inline real4 quat_conj(real4 q) { return make_real4(q.x, -q.y, -q.z, -q.w); }
static inline real4 quat_mul(real4 a, real4 b) {
  return make_real4(a.x * b.x - a.y * b.y - a.z * b.z - a.w * b.w,  //
                    a.x * b.y + a.y * b.x + a.z * b.w - a.w * b.z,  //
                    a.x * b.z - a.y * b.w + a.z * b.x + a.w * b.y,  //
                    a.x * b.w + a.y * b.z - a.z * b.y + a.w * b.x);
}

// Rotation matrix of a unit quaternion.
static inline Mat3 quat_to_rotmat(real4 q) {
  const real w = q.x, x = q.y, y = q.z, z = q.w, one = 1, two = 2;
  Mat3 r;
  r.r1 = make_real3(one - two * (y * y + z * z), two * (x * y - w * z), two * (x * z + w * y));
  r.r2 = make_real3(two * (x * y + w * z), one - two * (x * x + z * z), two * (y * z - w * x));
  r.r3 = make_real3(two * (x * z - w * y), two * (y * z + w * x), one - two * (x * x + y * y));
  return r;
}
static inline real4 quat_to_rotmat_vjp(real4 q, Mat3 v) {
  const real w = q.x, x = q.y, y = q.z, z = q.w, two = 2;
  const real s12 = v.r1.y + v.r2.x, s13 = v.r1.z + v.r3.x, s23 = v.r2.z + v.r3.y;
  const real a1 = v.r3.y - v.r2.z, a2 = v.r1.z - v.r3.x, a3 = v.r2.x - v.r1.y;
  return make_real4(two * (x * a1 + y * a2 + z * a3),
                    two * (w * a1 - two * x * (v.r2.y + v.r3.z) + y * s12 + z * s13),
                    two * (w * a2 + x * s12 - two * y * (v.r1.x + v.r3.z) + z * s23),
                    two * (w * a3 + x * s13 + y * s23 - two * z * (v.r1.x + v.r2.y)));
}

// The factor L = R(q/|q|) diag(scales) of a covariance L L^T.
static inline Mat3 factor_of(real4 quat, real3 scales) {
  Mat3 r = quat_to_rotmat(quat_normalize(quat).q);
  r.r1 = make_real3(r.r1.x * scales.x, r.r1.y * scales.y, r.r1.z * scales.z);
  r.r2 = make_real3(r.r2.x * scales.x, r.r2.y * scales.y, r.r2.z * scales.z);
  r.r3 = make_real3(r.r3.x * scales.x, r.r3.y * scales.y, r.r3.z * scales.z);
  return r;
}
typedef struct FactorGradient {
  real4 quat;
  real3 scales;
} FactorGradient;
static inline FactorGradient factor_of_vjp(real4 quat, real3 scales, Mat3 v) {
  const UnitQuat u = quat_normalize(quat);
  const Mat3 r = quat_to_rotmat(u.q);
  FactorGradient g;
  g.scales = make_real3(r.r1.x * v.r1.x + r.r2.x * v.r2.x + r.r3.x * v.r3.x,
                        r.r1.y * v.r1.y + r.r2.y * v.r2.y + r.r3.y * v.r3.y,
                        r.r1.z * v.r1.z + r.r2.z * v.r2.z + r.r3.z * v.r3.z);
  Mat3 v_r;
  v_r.r1 = make_real3(v.r1.x * scales.x, v.r1.y * scales.y, v.r1.z * scales.z);
  v_r.r2 = make_real3(v.r2.x * scales.x, v.r2.y * scales.y, v.r2.z * scales.z);
  v_r.r3 = make_real3(v.r3.x * scales.x, v.r3.y * scales.y, v.r3.z * scales.z);
  g.quat = quat_normalize_vjp(u, quat_to_rotmat_vjp(u.q, v_r));
  return g;
}

#endif
