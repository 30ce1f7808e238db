// SPDX-License-Identifier: Apache-2.0
// How a splat moves the pixels under it from t1 to t2:
//   flow(x) = (mu2 - mu1) + H z,  z = K (x - mu1),  H = (A - I) U
// with K and U of shared/projection.h and one of four maps A:
//   TRANSPORT_PAPER      A = B2 inv(B1), B the symmetric square root of S (GaussianFlow eq. 8)
//   TRANSPORT_OT         A = the Monge map from N(mu1, S1) to N(mu2, S2)
//   TRANSPORT_MATERIAL   A = I + (M2 - M1) M1^T inv(S1): the projected 3D motion itself
//   TRANSPORT_TRANSLATE  A = I                                      (GaussianFlow eq. 9)
// H is formed from differences, so nothing cancels for small motion. No eigenvectors are used: all
// maps and derivatives are smooth at equal eigenvalues.
#ifndef GFLOW_TRANSPORT_H
#define GFLOW_TRANSPORT_H
#include "shared/projection.h"

#define TRANSPORT_PAPER 0
#define TRANSPORT_OT 1
#define TRANSPORT_MATERIAL 2
#define TRANSPORT_TRANSLATE 3

// Symmetric square root B = (S + s I)/tau of a covariance S; s = det B, tau = tr B.
typedef struct Root2 {
  Sym2 b;
  real s, tau;
} Root2;
static inline Root2 root2(Sym2 cov, real det) {
  Root2 r;
  r.s = sqrt(det);
  r.tau = sqrt(sym2_trace(cov) + (real)2 * r.s);
  r.b = sym2_scale(make_sym2(cov.a + r.s, cov.b, cov.c + r.s), (real)1 / r.tau);
  return r;
}
// The X with B X + X B = Q, X = (s Q + adj(B) Q adj(B)) / (2 tr(B) s) with s = det B: the terms
// have like signs, so nothing cancels.
static inline Sym2 lyapunov2(Sym2 b, real det, Sym2 q) {
  const Sym2 adj = sym2_adj(b);
  const Sym2 sum = sym2_add(sym2_scale(q, det), sym2_congruence(mat2_of(adj), q));
  return sym2_scale(sum, (real)1 / ((real)2 * sym2_trace(b) * det));
}
// S2 - S1 from the factors, without cancellation.
static inline Sym2 covariance_change(Mat23 m1, Mat23 m2) {
  return mat2_sym(mat23_outer(mat23_sub(m2, m1), mat23_add(m1, m2)));
}
// B2 - B1 = lyap((B1 + B2)/2, S2 - S1), exactly.
static inline Sym2 root_change(Root2 r1, Root2 r2, Mat23 m1, Mat23 m2) {
  const Sym2 mean = sym2_scale(sym2_add(r1.b, r2.b), (real)0.5f);
  return lyapunov2(mean, mean.a * mean.c - mean.b * mean.b, covariance_change(m1, m2));
}
// Q = inv(B1) U, a rotation.
static inline Mat2 root_to_triangular(Whitening w, Root2 r) {
  const real x = w.s.c + r.s, y = -w.s.b;
  const real inverse = (real)1 / sqrt(x * x + y * y);
  return make_mat2(x * inverse, -y * inverse, y * inverse, x * inverse);
}

// T - I of the Monge map T = (S2 + (s2/s1) adj S1)/n, n = sqrt(tr(S1 S2) + 2 s1 s2), from
// differences. With D = S2 - S1 and r = s2/s1:
//   n (T - I) = D + (1 - r) S1 + (r tr S1 - n) I.
typedef struct Monge2 {
  real s1, s2, r, n;
  Sym2 change;  // T - I
} Monge2;
static inline Monge2 monge2(Whitening w1, Whitening w2, Mat23 m1, Mat23 m2) {
  Monge2 o;
  const Sym2 d = covariance_change(m1, m2);
  const Mat23 e = mat23_sub(m2, m1);
  // det S2 - det S1 from the change of the minors, e1 x r2' + r1 x e2.
  const real3 minors1 = cross(m1.r1, m1.r2), minors2 = cross(m2.r1, m2.r2);
  const real3 change = cross(e.r1, m2.r2) + cross(m1.r1, e.r2);
  const real det_change = dot(change, minors1 + minors2) + (real)DILATION * sym2_trace(d);
  o.s1 = sqrt(w1.det);
  o.s2 = sqrt(w2.det);
  const real s_change = det_change / (o.s1 + o.s2);
  const real r_change = s_change / o.s1;  // r - 1
  const real t1 = sym2_trace(w1.s);
  o.r = o.s2 / o.s1;
  o.n = sqrt(sym2_inner(w1.s, w2.s) + (real)2 * o.s1 * o.s2);
  const real n_change = (sym2_inner(w1.s, d) + (real)2 * o.s1 * s_change) / (o.n + t1);  // n - t1
  const real diagonal = r_change * t1 - n_change;
  const Sym2 sum = sym2_add(d, sym2_scale(w1.s, -r_change));
  o.change = sym2_scale(make_sym2(sum.a + diagonal, sum.b, sum.c + diagonal), (real)1 / o.n);
  return o;
}

// W = K M, for the material transport H = E W^T with E = M2 - M1. With b = r1.r2 and c = |r2|^2 +
// DILATION its first row is k1 (r1 - (b/c) r2), which cancels for long, thin splats (an error of
// 1e-5 in H at 300 x 1 px). The equal k1/c (r2 x (r1 x r2) + DILATION r1) does not (2e-7).
static inline Mat23 whitened_factor(Whitening w, Mat23 m) {
  const real3 minors = cross_exactly(m.r1, m.r2);
  return make_mat23((cross(m.r2, minors) + m.r1 * (real)DILATION) * (w.k1 / w.s.c), m.r2 * w.k3);
}

// H of one splat; `mode` is one of TRANSPORT_*.
static inline Mat2 transport(int mode, Mat23 m1, Whitening w1, Mat23 m2) {
  if (mode == TRANSPORT_PAPER) {
    const Whitening w2 = whiten(m2);
    const Root2 r1 = root2(w1.s, w1.det), r2 = root2(w2.s, w2.det);
    return mat2_mul(mat2_of(root_change(r1, r2, m1, m2)), root_to_triangular(w1, r1));
  }
  if (mode == TRANSPORT_OT)
    return mat2_mul(mat2_of(monge2(w1, whiten(m2), m1, m2).change), whitening_u(w1));
  if (mode == TRANSPORT_MATERIAL)
    return mat23_outer(mat23_sub(m2, m1), whitened_factor(w1, m1));
  return make_mat2((real)0, (real)0, (real)0, (real)0);
}

typedef struct TransportGradient {
  Mat23 m1, m2;
} TransportGradient;

// Gradient with respect to M1 and M2 of sum v . (H z), given gh = sum v z^T collected at fixed
// pixels. Includes the dependence of z on M1.
static inline TransportGradient transport_vjp(int mode, Mat23 m1, Whitening w1, Mat23 m2, Mat2 gh) {
  TransportGradient g;
  const real3 zero = make_real3((real)0, (real)0, (real)0);
  g.m1 = make_mat23(zero, zero);
  g.m2 = g.m1;
  if (mode == TRANSPORT_PAPER) {
    const Whitening w2 = whiten(m2);
    const Root2 r1 = root2(w1.s, w1.det), r2 = root2(w2.s, w2.det);
    const Mat2 p = mat2_mul(gh, mat2_transpose(root_to_triangular(w1, r1)));
    const Mat2 c1 = mat2_of(sym2_scale(sym2_adj(r1.b), (real)1 / r1.s));
    const Mat2 turn = mat2_mul(mat2_mul(c1, mat2_of(root_change(r1, r2, m1, m2))), p);
    const Mat2 both = make_mat2(p.a + turn.a, p.b + turn.b, p.c + turn.c, p.d + turn.d);
    g.m2 = covariance_vjp(m2, lyapunov2(r2.b, r2.s, mat2_sym(p)));
    g.m1 = covariance_vjp(m1, sym2_scale(lyapunov2(r1.b, r1.s, mat2_sym(both)), (real)-1));
  } else if (mode == TRANSPORT_OT) {
    const Whitening w2 = whiten(m2);
    const Monge2 o = monge2(w1, w2, m1, m2);
    const Sym2 ga = mat2_sym(mat2_mul(gh, mat2_transpose(whitening_u(w1))));  // w.r.t. A, symmetric
    const Sym2 t = make_sym2(o.change.a + (real)1, o.change.b, o.change.c + (real)1);
    const real gamma = sym2_inner(ga, t) / o.n;
    const real beta = sym2_inner(ga, sym2_adj(w1.s)) / o.n, half_n = (real)0.5f / o.n;
    const Sym2 x2 = sym2_add(
        sym2_add(sym2_scale(ga, (real)1 / o.n), sym2_scale(w1.s, -gamma * half_n)),
        sym2_scale(sym2_adj(w2.s), (beta / o.s1 - gamma * o.s1 / o.n) * (real)0.5f / o.s2));
    const Sym2 x1 = sym2_add(
        sym2_add(sym2_scale(sym2_adj(ga), o.r / o.n), sym2_scale(w2.s, -gamma * half_n)),
        sym2_scale(sym2_adj(w1.s),
                   -(beta * o.s2 / (o.s1 * o.s1) + gamma * o.s2 / o.n) * (real)0.5f / o.s1));
    g.m2 = covariance_vjp(m2, x2);
    g.m1 = covariance_vjp(m1, x1);
  } else if (mode == TRANSPORT_MATERIAL) {
    const Mat2 k = whitening_k(w1);
    const Mat23 e = mat23_sub(m2, m1), w = whitened_factor(w1, m1);
    const Mat2 h = mat23_outer(e, w), ght = mat2_transpose(gh);
    const Mat2 hg = mat2_mul(mat2_transpose(h), gh);
    const Mat2 both = make_mat2(hg.a + hg.a, hg.b + hg.c, hg.c + hg.b, hg.d + hg.d);
    const Mat23 inner = mat23_sub(mat23_left(ght, e), mat23_left(both, w));
    g.m2 = mat23_left(gh, w);
    g.m1 = mat23_sub(mat23_left(mat2_transpose(k), inner), g.m2);
  }
  return g;
}

#endif
