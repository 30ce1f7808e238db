// SPDX-License-Identifier: Apache-2.0
// Projects Gaussians at t1 to packed splats, then adds colour and the flow to t2. In two kernels,
// so that colour and t2 are needed for visible Gaussians only. project_fwd decides visibility:
// tiles_touched[i] = 0 means not visible. Every later step skips such a row, and no splat is
// written for it. One work-item per Gaussian.
// Defines: FLOW 0|1, TRANSPORT (shared/transport.h), DETACH_T1 0|1, ABSGRAD 0|1 (shared/pixel.h),
// TIGHT_BOXES 0|1 (Skips::boxes).
#include "shared/arrays.h"
#include "shared/transport.h"

#ifndef FLOW
#define FLOW 1
#endif
#ifndef TRANSPORT
#define TRANSPORT TRANSPORT_PAPER
#endif
#ifndef ABSGRAD
#define ABSGRAD 0
#endif
#define SQRT_2 1.41421356f
#ifndef DETACH_T1
#define DETACH_T1 0
#endif
#ifndef TIGHT_BOXES
#define TIGHT_BOXES 1
#endif

// Marks, as the x of m, a flow that could not be computed: it is drawn as 0 and has no gradient. No
// other flow has these bits, since adding +0.f turns -0 into +0.
#define NO_FLOW -0.f
static inline bool has_no_flow(float m_x) { return as_uint(m_x) == as_uint(NO_FLOW); }

// First and last tile touched on one axis by [centre - reach, centre + reach], counting pixel
// centres only; first > last when none.
static inline int2 tile_span(float centre, float reach, int pixels) {
  const float lo = centre - reach - 0.5f, hi = centre + reach - 0.5f, last = (float)(pixels - 1);
  if (!(lo <= last && hi >= 0.f)) return (int2)(1, 0);  // NaN: none
  // PoCL's ceil, floor, fmin and fmax take a dozen instructions each.
  const float from = lo > 0.f ? lo : 0.f, to = hi < last ? hi : last;
  int first = (int)from;
  first += (float)first < from;
  return (int)to >= first ? (int2)(first / TILE, (int)to / TILE) : (int2)(1, 0);
}

// Whether one of the tiles in a box (first x y, last x y) has flow.
static inline uint touches_flow(ushort4 box, uint tiles_x, global const float* flow_tiles) {
  for (uint row = box.y; row <= box.w; ++row)
    for (uint column = box.x; column <= box.z; ++column)
      if (flow_tiles[row * tiles_x + column] != 0.f) return 1;
  return 0;
}

// Places the splats and the tiles they cover. If `chosen`, flow_touched marks the splats that touch
// a tile with flow (View::flow_tiles); else it and flow_tiles are not accessed.
kernel void project_fwd(const uint n, const PinholeCamera camera, const int chosen,
                        global const float* restrict means,      // [N, 3] world, at t1
                        global const float* restrict factors,    // [N, 3, 3] covariance = L L^T
                        global const float* restrict opacities,  // [N] 0: not visible at t1
                        global const float* restrict flow_tiles,  // [tiles] 0: no flow
                        global float* restrict splats,           // [N, 16] see shared/pixel.h
                        global ushort* restrict tile_boxes,      // [N, 4] first x y, last x y
                        global uint* restrict tiles_touched,     // [N]
                        global uint* restrict flow_touched,      // [N] 0 or 1
                        global uint* restrict depth_keys) {      // [N] monotone in depth
  const uint i = get_global_id(0);
  if (i >= n) return;
  tiles_touched[i] = 0;
  if (chosen) flow_touched[i] = 0;
  const float opacity = opacities[i];
  if (opacity == 0.f) return;  // outside its time window, as most are in a long video
  const float log2_opacity = log2(opacity);
  if (!(log2_opacity >= ALPHA_MIN_LOG2)) return;  // NaN fails
  const Projection p = project(camera, load3(means, i), load_mat3(factors, i));
  if (!(p.p.z >= camera.near_plane)) return;

  // alpha >= 1/255 where |z|^2 <= log2(255 o) (scaled z): an ellipse with half extents sqrt(reach
  // S_xx) and sqrt(reach S_yy). The margin of 1e-3 is for rounding: no pixel that passes the pixel
  // test may be lost.
  const float s_xx = dot(p.m.r1, p.m.r1) + DILATION, s_yy = dot(p.m.r2, p.m.r2) + DILATION;
#if TIGHT_BOXES
  float reach = (log2_opacity - ALPHA_MIN_LOG2 + 1e-3f) / HALF_LOG2_E;
#ifdef BOX_SIGMAS  // `gflow bench pareto`: crops the box, to measure what that would save
  reach = fmin(reach, BOX_SIGMAS * BOX_SIGMAS);
#endif
  const float reach_x = sqrt(reach * s_xx), reach_y = sqrt(reach * s_yy);
#else  // as if opaque, and in every direction as long as along the longer axis
  const float half_difference = 0.5f * (s_xx - s_yy), s_xy = dot(p.m.r1, p.m.r2);
  const float longest =
      0.5f * (s_xx + s_yy) + sqrt(half_difference * half_difference + s_xy * s_xy);
  const float reach_x = sqrt((1e-3f - ALPHA_MIN_LOG2) / HALF_LOG2_E * longest), reach_y = reach_x;
#endif
  const int2 x = tile_span(p.mean.x, reach_x, camera.width);
  const int2 y = tile_span(p.mean.y, reach_y, camera.height);
  if (x.x > x.y || y.x > y.y) return;
  const Whitening w = whiten(p.m);
  const float sum = p.mean.x + p.mean.y + p.p.z + w.k1 + w.k2 + w.k3 + log2_opacity + w.det;
  if (!is_finite_real(sum)) return;  // z too: an infinitely distant mean projects to finite pixels

  const float3 k = (float3)(w.k1, w.k2, w.k3) * SQRT_HALF_LOG2_E;
  vstore4((float4)(p.mean.x, p.mean.y, k.x, k.y), 4 * i, splats);
  vstore4((float4)(k.z, log2_opacity, p.p.z, 0.f), 4 * i + 1, splats);
  const ushort4 box = (ushort4)(x.x, y.x, x.y, y.y);
  vstore4(box, i, tile_boxes);
  if (chosen) flow_touched[i] = touches_flow(box, (camera.width + TILE - 1) / TILE, flow_tiles);
  tiles_touched[i] = (uint)(x.y - x.x + 1) * (uint)(y.y - y.x + 1);
  depth_keys[i] = as_uint(p.p.z);  // z > 0: the bits are ordered
}

// Adds colour and flow to the visible splats. Rows from `moving` on are static in this view
// (View::moving); rows with rows_with_flow 0 touch no tile that has flow.
kernel void transport_fwd(const uint n, const uint moving, const PinholeCamera camera,
                          const PinholeCamera camera2,
                          global const float* restrict means, global const float* restrict factors,
                          global const float* restrict colors,      // [N, 3]
                          global const float* restrict means_t2,    // [N, 3]
                          global const float* restrict factors_t2,  // [N, 3, 3]
                          global const uint* restrict tiles_touched,
                          global const uint* restrict rows_with_flow,  // [N]
                          global float* restrict splats) {
  const uint i = get_global_id(0);
  if (i >= n || tiles_touched[i] == 0) return;
  const float3 c = load3(colors, i);
  // A non-finite colour must not be drawn: 0 x NaN would reach distant pixels.
  if (!is_finite_real(c.x + c.y + c.z)) splats[16 * i + 5] = -INFINITY;
  float2 m = (float2)(0.f);
  float4 h = (float4)(0.f);
#if FLOW
  if (i < moving && rows_with_flow[i]) {
    const Projection p2 = project(camera2, load3(means_t2, i), load_mat3(factors_t2, i));
    bool formed = p2.p.z >= camera.near_plane;  // behind camera 2 the flow is undefined
    if (formed) {
      const Projection p = project(camera, load3(means, i), load_mat3(factors, i));
      const Mat2 h2 = transport(TRANSPORT, p.m, whiten(p.m), p2.m);
      m = p2.mean - p.mean + 0.f;
      h = (float4)(h2.a, h2.b, h2.c, h2.d) * (1.f / SQRT_HALF_LOG2_E);
      formed = is_finite_real(m.x + m.y + h.x + h.y + h.z + h.w);
    }
    if (!formed) {
      m = (float2)(NO_FLOW, 0.f);
      h = (float4)(0.f);
    }
  }
#endif
  splats[16 * i + 7] = m.x;
  vstore4((float4)(c.x, c.y, c.z, m.y), 4 * i + 2, splats);
  vstore4(h, 4 * i + 3, splats);
}

// From the 16 moments of each splat (kernel gather) to gradients of the Gaussians at both times.
// Rows that are not visible are unchanged. For static rows (from `moving` on) v_means_t2 is the
// flow's gradient w.r.t. the mean at t2, which v_means does not include; v_factors_t2 is unchanged.
kernel void project_bwd(const uint n, const uint moving, const PinholeCamera camera,
                        const PinholeCamera camera2,
                        global const float* restrict means, global const float* restrict factors,
                        global const float* restrict opacities,
                        global const float* restrict means_t2,
                        global const float* restrict factors_t2,
                        global const float* restrict splats,
                        global const uint* restrict tiles_touched,
                        global const float* restrict moments,  // [N, 16]
                        global float* restrict v_means,        // [N, 3]
                        global float* restrict v_factors,      // [N, 3, 3]
                        global float* restrict v_opacities,    // [N]
                        global float* restrict v_colors,       // [N, 3]
                        global float* restrict v_means_t2,     // [N, 3]
                        global float* restrict v_factors_t2,   // [N, 3, 3]
                        global float* restrict v_means2d) {    // [N, 2] for density control
  const uint i = get_global_id(0);
  if (i >= n || tiles_touched[i] == 0) return;
  const real3 zero3 = make_real3(0.f, 0.f, 0.f);
  Mat3 zero;
  zero.r1 = zero.r2 = zero.r3 = zero3;
  // q qz1 qz2 qz11 | qz12 qz22 wr wg | wb wd fx fy | fx1 fx2 fy1 fy2 (shared/pixel.h)
  const float4 s0 = vload4(4 * i, moments), s1 = vload4(4 * i + 1, moments);
  const float4 s2 = vload4(4 * i + 2, moments);
  const Mat3 factor = load_mat3(factors, i);
  const Projection p = project(camera, load3(means, i), factor);
  const Whitening w = whiten(p.m);

  // The gradient of e = log2 o - |z|^2 (scaled z) w.r.t. mu1 is 2 K^T z, and w.r.t. S1 K^T z z^T K
  // with the unscaled K. LN_2 makes v_exponent of q.
  const float k1 = w.k1 * SQRT_HALF_LOG2_E, k2 = w.k2 * SQRT_HALF_LOG2_E;
  const float k3 = w.k3 * SQRT_HALF_LOG2_E;
  real2 v_mean = make_real2(2.f * LN_2 * k1 * s0.y, 2.f * LN_2 * (k2 * s0.y + k3 * s0.z));
  const Sym2 zz = make_sym2(s0.w, s1.x, s1.y);
  const Sym2 v_s = sym2_scale(sym2_congruence(mat2_transpose(whitening_k(w)), zz), LN_2);
  Mat23 v_m = covariance_vjp(p.m, v_s);
  v_opacities[i] = s0.x / opacities[i];
  store3(v_colors, i, make_real3(s1.z, s1.w, s2.x));
  // For density control: wrong coverage asks for more Gaussians, wrong motion does not.
#if ABSGRAD
  const float v_depth = 0.f;
  vstore2((float2)(SQRT_2 * LN_2 * s2.y), i, v_means2d);
#else
  const float v_depth = s2.y;
  vstore2(v_mean, i, v_means2d);
#endif

#if FLOW
  const float2 g = (float2)(s2.z, s2.w);  // w.r.t. m
  const float4 s3 = vload4(4 * i + 3, moments);
  real3 v_mean2 = zero3;
  if (i >= moving) {
    Mat23 none;
    none.r1 = none.r2 = zero3;
    if (any(g != 0.f)) v_mean2 = project_vjp(camera, factor, p, g, 0.f, none).mean;
  } else {
    Mat3 v_factor2 = zero;
    if ((any(g != 0.f) || any(s3 != 0.f)) && !has_no_flow(splats[16 * i + 7])) {
      const Mat3 factor2 = load_mat3(factors_t2, i);
      const Projection p2 = project(camera2, load3(means_t2, i), factor2);
      const Mat2 gh = make_mat2(s3.x / SQRT_HALF_LOG2_E, s3.y / SQRT_HALF_LOG2_E,
                                s3.z / SQRT_HALF_LOG2_E, s3.w / SQRT_HALF_LOG2_E);
      const TransportGradient t = transport_vjp(TRANSPORT, p.m, w, p2.m, gh);
      const GaussianGradient v2 = project_vjp(camera2, factor2, p2, g, 0.f, t.m2);
      v_mean2 = v2.mean;
      v_factor2 = v2.factor;
#if !DETACH_T1
      // flow = mu2 - mu1 + H K (x - mu1)
      const float4 h = vload4(4 * i + 3, splats);
      const float hg1 = h.x * g.x + h.z * g.y, hg2 = h.y * g.x + h.w * g.y;  // H^T g, scaled H
      v_mean -= g + (float2)(k1 * hg1, k2 * hg1 + k3 * hg2);
      v_m = mat23_add(v_m, t.m1);
#endif
    }
    store_mat3(v_factors_t2, i, v_factor2);
  }
  store3(v_means_t2, i, v_mean2);
#endif
  const GaussianGradient v = project_vjp(camera, factor, p, v_mean, v_depth, v_m);
  store3(v_means, i, v.mean);
  store_mat3(v_factors, i, v.factor);
}
