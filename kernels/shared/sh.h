// SPDX-License-Identifier: Apache-2.0
// Real spherical harmonics Y_k to degree 3, with the signs and order of 3DGS files. A colour is
// max(0, 1/2 + sum_k sh_k Y_k(direction)).
#ifndef GFLOW_SH_H
#define GFLOW_SH_H
#include "shared/dialect.h"

#define SH_C0 0.28209479177387814f
#define SH_C1 0.4886025119029199f
#define SH_C2A 1.0925484305920792f
#define SH_C2B 0.31539156525252005f
#define SH_C2C 0.5462742152960396f
#define SH_C3A 0.5900435899266435f
#define SH_C3B 2.890611442640554f
#define SH_C3C 0.4570457994644658f
#define SH_C3D 0.3731763325901154f
#define SH_C3E 1.445305721320277f

typedef struct ShBasis {
  real y[16];
} ShBasis;

// The (degree + 1)^2 basis values in direction d, |d| = 1; the others are 0.
static inline ShBasis sh_basis(int degree, real3 d) {
  ShBasis b;
  for (int k = 0; k < 16; ++k) b.y[k] = (real)0;
  const real x = d.x, y = d.y, z = d.z, xx = x * x, yy = y * y, zz = z * z;
  b.y[0] = SH_C0;
  if (degree >= 1) {
    b.y[1] = -SH_C1 * y;
    b.y[2] = SH_C1 * z;
    b.y[3] = -SH_C1 * x;
  }
  if (degree >= 2) {
    b.y[4] = SH_C2A * x * y;
    b.y[5] = -SH_C2A * y * z;
    b.y[6] = SH_C2B * ((real)2 * zz - xx - yy);
    b.y[7] = -SH_C2A * x * z;
    b.y[8] = SH_C2C * (xx - yy);
  }
  if (degree >= 3) {
    b.y[9] = -SH_C3A * y * ((real)3 * xx - yy);
    b.y[10] = SH_C3B * x * y * z;
    b.y[11] = -SH_C3C * y * ((real)4 * zz - xx - yy);
    b.y[12] = SH_C3D * z * ((real)2 * zz - (real)3 * xx - (real)3 * yy);
    b.y[13] = -SH_C3C * x * ((real)4 * zz - xx - yy);
    b.y[14] = SH_C3E * z * (xx - yy);
    b.y[15] = -SH_C3A * x * (xx - (real)3 * yy);
  }
  return b;
}
// Gradient w.r.t. the direction (as a free vector), given that w.r.t. the basis values.
static inline real3 sh_basis_vjp(int degree, real3 d, ShBasis v) {
  real3 g = make_real3((real)0, (real)0, (real)0);
  const real x = d.x, y = d.y, z = d.z, xx = x * x, yy = y * y, zz = z * z, two = 2;
  if (degree >= 1) g = make_real3(-SH_C1 * v.y[3], -SH_C1 * v.y[1], SH_C1 * v.y[2]);
  if (degree >= 2) {
    g.x += SH_C2A * (y * v.y[4] - z * v.y[7]) + two * x * (SH_C2C * v.y[8] - SH_C2B * v.y[6]);
    g.y += SH_C2A * (x * v.y[4] - z * v.y[5]) - two * y * (SH_C2C * v.y[8] + SH_C2B * v.y[6]);
    g.z += -SH_C2A * (y * v.y[5] + x * v.y[7]) + (real)4 * SH_C2B * z * v.y[6];
  }
  if (degree >= 3) {
    const real six = 6, eight = 8, three = 3;
    g.x += -SH_C3A * (six * x * y * v.y[9] + three * (xx - yy) * v.y[15]) +
           SH_C3B * y * z * v.y[10] - SH_C3D * six * x * z * v.y[12] +
           SH_C3C * (two * x * y * v.y[11] - ((real)4 * zz - three * xx - yy) * v.y[13]) +
           SH_C3E * two * x * z * v.y[14];
    g.y += -SH_C3A * (three * (xx - yy) * v.y[9] - six * x * y * v.y[15]) +
           SH_C3B * x * z * v.y[10] - SH_C3D * six * y * z * v.y[12] +
           SH_C3C * (two * x * y * v.y[13] - ((real)4 * zz - xx - three * yy) * v.y[11]) -
           SH_C3E * two * y * z * v.y[14];
    g.z += SH_C3B * x * y * v.y[10] - SH_C3C * eight * z * (y * v.y[11] + x * v.y[13]) +
           SH_C3D * three * (two * zz - xx - yy) * v.y[12] + SH_C3E * (xx - yy) * v.y[14];
  }
  return g;
}

// Unit vector from the camera to a point, or 0 if they coincide. Derivative: (I - d d^T)/distance.
typedef struct Direction {
  real3 d;
  real inverse_distance;
} Direction;
static inline Direction direction_to(real3 point, real3 camera) {
  Direction o;
  const real3 v = point - camera;
  const real squared = dot(v, v);
  o.inverse_distance = squared > (real)0 ? (real)1 / sqrt(squared) : (real)0;
  o.d = v * o.inverse_distance;
  return o;
}
static inline real3 direction_to_vjp(Direction o, real3 v_d) {
  return (v_d - o.d * dot(o.d, v_d)) * o.inverse_distance;
}

#endif
