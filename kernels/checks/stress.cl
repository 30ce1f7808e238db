// SPDX-License-Identifier: Apache-2.0
// The float maths of one Gaussian, as in the engine's kernels, on arrays of cases for `gflow
// stress`: its metrics are the device's, not the host's. One work-item per case.
#include "shared/arrays.h"
#include "shared/transport.h"

static inline Mat23 load_mat23(global const float* p, uint i) {
  return make_mat23(load3(p, 2 * i), load3(p, 2 * i + 1));
}
static inline void store_mat23(global float* p, uint i, Mat23 m) {
  store3(p, 2 * i, m.r1);
  store3(p, 2 * i + 1, m.r2);
}

// A = B2 inv(B1) of two covariances, and the gradient of G : A with respect to them.
kernel void stress_roots(const uint n,
                         global const float* restrict pairs,  // [n, 8] a b c det, twice
                         global const float* restrict g,      // [n, 4]
                         global float* restrict maps,         // [n, 4] A
                         global float* restrict gradients) {  // [n, 6] X1, X2
  const uint i = get_global_id(0);
  if (i >= n) return;
  const float4 p1 = vload4(2 * i, pairs), p2 = vload4(2 * i + 1, pairs), q = vload4(i, g);
  const Root2 r1 = root2(make_sym2(p1.x, p1.y, p1.z), p1.w);
  const Root2 r2 = root2(make_sym2(p2.x, p2.y, p2.z), p2.w);
  const Mat2 c1 = mat2_of(sym2_scale(sym2_adj(r1.b), 1.f / r1.s)), b2 = mat2_of(r2.b);
  const Mat2 a = mat2_mul(b2, c1), gc = mat2_mul(make_mat2(q.x, q.y, q.z, q.w), c1);
  const Mat2 bg = mat2_mul(b2, make_mat2(q.x, q.y, q.z, q.w));
  const Sym2 x2 = lyapunov2(r2.b, r2.s, mat2_sym(gc));
  const Sym2 x1 = lyapunov2(r1.b, r1.s, sym2_scale(sym2_congruence(c1, mat2_sym(bg)), -1.f));
  vstore4((float4)(a.a, a.b, a.c, a.d), i, maps);
  store3(gradients, 2 * i, make_real3(x1.a, x1.b, x1.c));
  store3(gradients, 2 * i + 1, make_real3(x2.a, x2.b, x2.c));
}

// The whitening of a projected factor, and z of a pixel.
kernel void stress_whiten(const uint n, global const float* restrict factors,  // [n, 2, 3] M
                          global const float* restrict offsets,                // [n, 2] x - mu
                          global float* restrict dets,                         // [n]
                          global float* restrict z) {                          // [n, 2] K (x - mu)
  const uint i = get_global_id(0);
  if (i >= n) return;
  const Whitening w = whiten(load_mat23(factors, i));
  const float2 d = vload2(i, offsets);
  dets[i] = w.det;
  vstore2((float2)(w.k1 * d.x + w.k2 * d.y, w.k3 * d.y), i, z);
}

// H of a transport (shared/transport.h); the gradient of v . (H z) w.r.t. M1, M2 at fixed pixels.
kernel void stress_transport(const uint n, const int mode,
                             global const float* restrict m1,     // [n, 2, 3]
                             global const float* restrict m2,     // [n, 2, 3]
                             global const float* restrict gh,     // [n, 4] sum v z^T
                             global float* restrict h,            // [n, 4]
                             global float* restrict v_m1,         // [n, 2, 3]
                             global float* restrict v_m2) {       // [n, 2, 3]
  const uint i = get_global_id(0);
  if (i >= n) return;
  const Mat23 a = load_mat23(m1, i), b = load_mat23(m2, i);
  const Whitening w = whiten(a);
  const Mat2 found = transport(mode, a, w, b);
  const float4 g = vload4(i, gh);
  const TransportGradient v = transport_vjp(mode, a, w, b, make_mat2(g.x, g.y, g.z, g.w));
  vstore4((float4)(found.a, found.b, found.c, found.d), i, h);
  store_mat23(v_m1, i, v.m1);
  store_mat23(v_m2, i, v.m2);
}

// The projection of a Gaussian, and its gradient.
kernel void stress_project(const uint n, const PinholeCamera camera,
                           global const float* restrict means,      // [n, 3]
                           global const float* restrict factors,    // [n, 3, 3]
                           global const float* restrict v_means2d,  // [n, 2]
                           global const float* restrict v_depths,   // [n]
                           global const float* restrict v_m,        // [n, 2, 3]
                           global float* restrict means2d,          // [n, 2]
                           global float* restrict m,                // [n, 2, 3]
                           global float* restrict v_means,          // [n, 3]
                           global float* restrict v_factors) {      // [n, 3, 3]
  const uint i = get_global_id(0);
  if (i >= n) return;
  const Mat3 factor = load_mat3(factors, i);
  const Projection p = project(camera, load3(means, i), factor);
  const GaussianGradient v =
      project_vjp(camera, factor, p, vload2(i, v_means2d), v_depths[i], load_mat23(v_m, i));
  vstore2(p.mean, i, means2d);
  store_mat23(m, i, p.m);
  store3(v_means, i, v.mean);
  store_mat3(v_factors, i, v.factor);
}
