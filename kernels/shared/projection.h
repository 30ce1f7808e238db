// SPDX-License-Identifier: Apache-2.0
// Projects one Gaussian, given by its mean and its covariance factor L (covariance L L^T), to the
// image: EWA splatting (Zwicker et al. 2001).
//   M = J W L,  S = M M^T + DILATION I,  K upper triangular with K^T K = inv(S)
// J is the projection's Jacobian at the mean, W the camera's rotation. det S is computed from the
// minors of M and the exponent from K: both stay accurate for long, thin splats, unlike a c - b b
// and the conic.
#ifndef GFLOW_PROJECTION_H
#define GFLOW_PROJECTION_H
#include "shared/constants.h"
#include "shared/linear.h"
#include "shared/types.h"

typedef struct Projection {
  real3 p;                 // in camera coordinates; p.z is the depth
  real2 mean;              // [px]
  real u, v;               // X/Z and Y/Z, clamped to the image plus FOV_MARGIN
  int u_inside, v_inside;  // 1: not clamped, so it carries a gradient
  real3 w1, w2;            // rows of J W
  Mat23 m;                 // J W L
} Projection;

static inline Projection project(PinholeCamera cam, real3 mean, Mat3 factor) {
  Projection o;
  const real3 row1 = make_real3(cam.rotation[0], cam.rotation[1], cam.rotation[2]);
  const real3 row2 = make_real3(cam.rotation[3], cam.rotation[4], cam.rotation[5]);
  const real3 row3 = make_real3(cam.rotation[6], cam.rotation[7], cam.rotation[8]);
  o.p = make_real3(dot(row1, mean) + cam.translation[0], dot(row2, mean) + cam.translation[1],
                   dot(row3, mean) + cam.translation[2]);
  const real inv_z = (real)1 / o.p.z, x = o.p.x * inv_z, y = o.p.y * inv_z;
  const real fx = cam.fx, fy = cam.fy, cx = cam.cx, cy = cam.cy;
  const real width = (real)(cam.full_width ? cam.full_width : cam.width);
  const real height = (real)(cam.full_height ? cam.full_height : cam.height);
  const real margin_x = (real)(FOV_MARGIN * 0.5f) * width / fx;
  const real margin_y = (real)(FOV_MARGIN * 0.5f) * height / fy;
  o.mean = make_real2(fx * x + (cx - cam.left), fy * y + (cy - cam.top));
  o.u = clamp(x, -(cx / fx + margin_x), (width - cx) / fx + margin_x);
  o.v = clamp(y, -(cy / fy + margin_y), (height - cy) / fy + margin_y);
  o.u_inside = o.u == x;
  o.v_inside = o.v == y;
  o.w1 = (row1 - row3 * o.u) * (fx * inv_z);
  o.w2 = (row2 - row3 * o.v) * (fy * inv_z);
  o.m.r1 = o.w1.x * factor.r1 + o.w1.y * factor.r2 + o.w1.z * factor.r3;
  o.m.r2 = o.w2.x * factor.r1 + o.w2.y * factor.r2 + o.w2.z * factor.r3;
  return o;
}

typedef struct GaussianGradient {
  real3 mean;
  Mat3 factor;
} GaussianGradient;

// Gradient with respect to mean and factor, given that with respect to projected mean, depth and M.
static inline GaussianGradient project_vjp(PinholeCamera cam, Mat3 factor, Projection o,
                                           real2 v_mean, real v_depth, Mat23 v_m) {
  GaussianGradient g;
  const real3 row1 = make_real3(cam.rotation[0], cam.rotation[1], cam.rotation[2]);
  const real3 row2 = make_real3(cam.rotation[3], cam.rotation[4], cam.rotation[5]);
  const real3 row3 = make_real3(cam.rotation[6], cam.rotation[7], cam.rotation[8]);
  g.factor.r1 = o.w1.x * v_m.r1 + o.w2.x * v_m.r2;
  g.factor.r2 = o.w1.y * v_m.r1 + o.w2.y * v_m.r2;
  g.factor.r3 = o.w1.z * v_m.r1 + o.w2.z * v_m.r2;
  const real3 v_w1 =
      make_real3(dot(factor.r1, v_m.r1), dot(factor.r2, v_m.r1), dot(factor.r3, v_m.r1));
  const real3 v_w2 =
      make_real3(dot(factor.r1, v_m.r2), dot(factor.r2, v_m.r2), dot(factor.r3, v_m.r2));
  // w1 = fx/Z (row1 - u row3), with u = X/Z unless it was clamped.
  const real inv_z = (real)1 / o.p.z, fx_z = cam.fx * inv_z, fy_z = cam.fy * inv_z;
  real v_x = fx_z * v_mean.x, v_y = fy_z * v_mean.y;
  real v_z = v_depth - (v_x * o.p.x + v_y * o.p.y + dot(o.w1, v_w1) + dot(o.w2, v_w2)) * inv_z;
  if (o.u_inside) {
    const real v_u = -fx_z * dot(row3, v_w1) * inv_z;
    v_x += v_u;
    v_z -= v_u * o.u;
  }
  if (o.v_inside) {
    const real v_v = -fy_z * dot(row3, v_w2) * inv_z;
    v_y += v_v;
    v_z -= v_v * o.v;
  }
  g.mean = row1 * v_x + row2 * v_y + row3 * v_z;
  return g;
}

// Covariance S = M M^T + DILATION I, its determinant from the minors of M, the upper triangular K
// with K^T K = inv(S), and U = inv(K).
typedef struct Whitening {
  Sym2 s;
  real det;
  real k1, k2, k3;  // K = [[k1, k2], [0, k3]]
  real u1, u2, u3;  // U = [[u1, u2], [0, u3]]
} Whitening;

static inline Whitening whiten(Mat23 m) {
  Whitening o;
  const real h = DILATION;
  const real n1 = dot(m.r1, m.r1), n2 = dot(m.r2, m.r2);
  const real3 minors = cross_exactly(m.r1, m.r2);
  o.s = make_sym2(n1 + h, dot(m.r1, m.r2), n2 + h);
  o.det = dot(minors, minors) + h * (n1 + n2) + h * h;
  o.u3 = sqrt(o.s.c);
  o.u1 = sqrt(o.det / o.s.c);
  o.u2 = o.s.b / o.u3;
  o.k1 = (real)1 / o.u1;
  o.k3 = (real)1 / o.u3;
  o.k2 = -(o.s.b / o.s.c) * o.k1;
  return o;
}
static inline Mat2 whitening_k(Whitening w) { return make_mat2(w.k1, w.k2, (real)0, w.k3); }
static inline Mat2 whitening_u(Whitening w) { return make_mat2(w.u1, w.u2, (real)0, w.u3); }

// dL/dM = 2 X M for a symmetric dL/dS = X.
static inline Mat23 covariance_vjp(Mat23 m, Sym2 v_s) {
  return mat23_left(mat2_of(sym2_scale(v_s, (real)2)), m);
}

#endif
