// SPDX-License-Identifier: Apache-2.0
// Distance of a Gaussian from a static one, in standard deviations: whether it needs motion at all.
#ifndef GFLOW_STATIC_DETECTION_H
#define GFLOW_STATIC_DETECTION_H
#include "shared/quat.h"

// Unit quaternion of a matrix near a rotation, from its largest component (Shepperd 1978).
static inline real4 quat_of_rotmat(Mat3 r) {
  const real one = 1;
  const real w = one + r.r1.x + r.r2.y + r.r3.z, x = one + r.r1.x - r.r2.y - r.r3.z;
  const real y = one - r.r1.x + r.r2.y - r.r3.z, z = one - r.r1.x - r.r2.y + r.r3.z;
  const real s12 = r.r1.y + r.r2.x, s13 = r.r1.z + r.r3.x, s23 = r.r2.z + r.r3.y;
  const real a1 = r.r3.y - r.r2.z, a2 = r.r1.z - r.r3.x, a3 = r.r2.x - r.r1.y;
  const real largest = fmax(fmax(w, x), fmax(y, z));
  real4 q = make_real4(w, a1, a2, a3);
  if (largest == x) q = make_real4(a1, x, s12, s13);
  if (largest == y) q = make_real4(a2, s12, y, s23);
  if (largest == z) q = make_real4(a3, s13, s23, z);
  return quat_normalize(q).q;
}

// S^-1 R^T L with S = diag(scales): the factor L in the axes and standard deviations of a Gaussian
// with factor R S. It is I for L = R S.
static inline Mat3 relative_factor(Mat3 rotation, real3 scales, Mat3 factor) {
  Mat3 m = mat3_mul(mat3_transpose(rotation), factor);
  m.r1 = m.r1 * ((real)1 / scales.x);
  m.r2 = m.r2 * ((real)1 / scales.y);
  m.r3 = m.r3 * ((real)1 / scales.z);
  return m;
}

// d = |S^-1 R^T (mean - static_mean)| + |S^-1 R^T L - I|, in standard deviations: the distance of a
// Gaussian with `mean` and factor L from a static one with `static_mean` and factor R S. To first
// order its density exp(-|z|^2 / 2) differs nowhere by more than .74 d: the shift changes it by
// |z| exp(-|z|^2 / 2) <= .61 times the first term, the change of the factor by
// |z|^2 exp(-|z|^2 / 2) <= .74 times the second.
static inline real distance_from_static(real3 static_mean, real4 quat, real3 scales, real3 mean,
                                        Mat3 factor) {
  const Mat3 rotation = quat_to_rotmat(quat_normalize(quat).q);
  const real3 d = mat3_transpose_mul_vec(rotation, mean - static_mean);
  const real3 shift = make_real3(d.x / scales.x, d.y / scales.y, d.z / scales.z);
  const Mat3 m =
      mat3_add(relative_factor(rotation, scales, factor), mat3_scale(mat3_identity(), (real)-1));
  return sqrt(dot(shift, shift)) + sqrt(dot(m.r1, m.r1) + dot(m.r2, m.r2) + dot(m.r3, m.r3));
}

#endif
