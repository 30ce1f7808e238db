// SPDX-License-Identifier: Apache-2.0
// What one splat does to LANES pixels, and the reverse (OpenCL C only). Forward and backward run
// the same visibility test on the same bits, so they agree on every contributor.
// Defines: FLOW, DEPTH 0|1; TOP_K 0 = all contributors make the flow, K = the first K in depth
// order (the paper's K = 20); EXCLUDE 0 = the splat that saturates a pixel is drawn, then the pixel
// stops; 1 = it stops before it, as the 3DGS family does (numerics 0.8).
#ifndef GFLOW_PIXEL_H
#define GFLOW_PIXEL_H
#include "shared/lane.h"

#ifndef FLOW
#define FLOW 1
#endif
#ifndef DEPTH
#define DEPTH 1
#endif
#ifndef TOP_K
#define TOP_K 0
#endif
#ifndef EXCLUDE
#define EXCLUDE 0
#endif
#ifndef DETACH_WEIGHTS
#define DETACH_WEIGHTS 0  // 1: no flow gradient to what is drawn where, only to how it moves
#endif

#ifndef ABSGRAD
#define ABSGRAD 0  // 1, without depth: the moment wd is the sum of |v_mean| / (2 ln 2) over pixels
#endif

// The packed splat as four float4:
//   a = mean x, y [px], k1, k2   b = k3, log2 opacity, depth, m_x
//   c = r, g, b, m_y             d = h11, h12, h21, h22
// K and H are scaled so that alpha = exp2(log2 o - |z|^2), z = K (x - mean), and
// flow = m + H z [px].
typedef struct Splat {
  float4 a, b, c, d;
} Splat;

static inline Splat splat_load(global const float* splats, uint i) {
  Splat s;
  s.a = vload4(4 * i, splats);
  s.b = vload4(4 * i + 1, splats);
  s.c = vload4(4 * i + 2, splats);
  s.d = vload4(4 * i + 3, splats);
  return s;
}

// Where the pixels stand in the splat and how much of its colour they take.
typedef struct Coverage {
  lane z1, z2;
  lane raw;    // alpha before the cut at ALPHA_MAX
  lane alpha;  // 0 where the splat does not count
  lane weight; // T alpha
  lane T;      // what passes on; with EXCLUDE the sign marks a finished pixel
} Coverage;

static inline Coverage cover(Splat s, lane dx, lane dy, lane T) {
  Coverage c;
  c.z1 = fma(TO_LANE(s.a.z), dx, TO_LANE(s.a.w) * dy);
  c.z2 = TO_LANE(s.b.x) * dy;
  const lane e = fma(-c.z1, c.z1, fma(-c.z2, c.z2, TO_LANE(s.b.y)));
  c.raw = lane_exp2(e);
  const lane cut = fmin(c.raw, TO_LANE(ALPHA_MAX));
  const lane_int touched = e >= TO_LANE(ALPHA_MIN_LOG2);
#if EXCLUDE
  const lane_int open = touched & (T > TO_LANE(0.f));
  const lane_int counts = open & (T * (TO_LANE(1.f) - cut) >= TO_LANE(T_MIN));
  c.alpha = LANE_SELECT(TO_LANE(0.f), cut, counts);
  c.weight = T * c.alpha;
  c.T = LANE_SELECT(T - c.weight, -T, open & ~counts);
#else
  const lane_int counts = touched & (T >= TO_LANE(T_MIN));
  c.alpha = LANE_SELECT(TO_LANE(0.f), cut, counts);
  c.weight = T * c.alpha;
  c.T = T - c.weight;
#endif
  return c;
}
// A pixel still takes splats.
static inline lane_int still_open(lane T) {
  return EXCLUDE ? T > TO_LANE(0.f) : T >= TO_LANE(T_MIN);
}
// Flow weight: the weight itself, or 0 after the first TOP_K contributors.
#if TOP_K
#define FLOW_WEIGHT(c, n) LANE_SELECT(TO_LANE(0.f), (c).weight, (n) < TO_LANE((float)TOP_K))
#define COUNT_CONTRIBUTOR(c, n) \
  LANE_SELECT((n), (n) + TO_LANE(1.f), (c).alpha > TO_LANE(0.f))
#else
#define FLOW_WEIGHT(c, n) ((c).weight)
#endif
static inline lane flow_x(Splat s, Coverage c) {
  return fma(TO_LANE(s.d.x), c.z1, fma(TO_LANE(s.d.y), c.z2, TO_LANE(s.b.w)));
}
static inline lane flow_y(Splat s, Coverage c) {
  return fma(TO_LANE(s.d.z), c.z1, fma(TO_LANE(s.d.w), c.z2, TO_LANE(s.c.w)));
}

// ---- forward: the sums of one lane vector
typedef struct PixelSums {
  lane T, W, r, g, b;  // W = sum of weights: 1 - T has lost it where W is small (numerics 2)
#if DEPTH
  lane depth;
#endif
#if FLOW
  lane fx, fy;
#endif
#if TOP_K
  lane n, W_flow;
#endif
} PixelSums;

static inline PixelSums pixel_start(void) {
  PixelSums s;
  s.T = TO_LANE(1.f);
  s.W = s.r = s.g = s.b = TO_LANE(0.f);
#if DEPTH
  s.depth = TO_LANE(0.f);
#endif
#if FLOW
  s.fx = s.fy = TO_LANE(0.f);
#endif
#if TOP_K
  s.n = s.W_flow = TO_LANE(0.f);
#endif
  return s;
}
static inline PixelSums pixel_blend(PixelSums p, Splat s, lane dx, lane dy) {
  const Coverage c = cover(s, dx, dy, p.T);
  p.T = c.T;
  p.W += c.weight;
  p.r = fma(c.weight, TO_LANE(s.c.x), p.r);
  p.g = fma(c.weight, TO_LANE(s.c.y), p.g);
  p.b = fma(c.weight, TO_LANE(s.c.z), p.b);
#if DEPTH
  p.depth = fma(c.weight, TO_LANE(s.b.z), p.depth);
#endif
#if FLOW
  const lane w = FLOW_WEIGHT(c, p.n);
  p.fx = fma(w, flow_x(s, c), p.fx);
  p.fy = fma(w, flow_y(s, c), p.fy);
#if TOP_K
  p.W_flow += w;
  p.n = COUNT_CONTRIBUTOR(c, p.n);
#endif
#endif
  return p;
}

// ---- backward: front to back with R, the share of v . output that is still to come
//   dL/d(exponent) = ln 2 (w gc - R alpha/(1 - alpha)),  gc = gradient by this weight
typedef struct PixelGrads {
  lane T, R;
  lane vr, vg, vb;
#if DEPTH
  lane vd;
#endif
#if FLOW
  lane vfx, vfy;  // v_flow / W
  lane v0;        // what every flow weight gets: -(v_flow . flow)/W
#endif
#if TOP_K
  lane n;
#endif
} PixelGrads;

// The 16 sums of one splat, as lanes: q = v_exponent / ln 2.
typedef struct Moments {
  lane q, qz1, qz2, qz11, qz12, qz22;
  lane wr, wg, wb, wd;
  lane fx, fy, fx1, fx2, fy1, fy2;  // w v_flow, and that times z
} Moments;

static inline Moments moments_zero(void) {
  Moments m;
  m.q = m.qz1 = m.qz2 = m.qz11 = m.qz12 = m.qz22 = TO_LANE(0.f);
  m.wr = m.wg = m.wb = m.wd = TO_LANE(0.f);
  m.fx = m.fy = m.fx1 = m.fx2 = m.fy1 = m.fy2 = TO_LANE(0.f);
  return m;
}

// Adds what this splat's pixels say; returns the pixels' new state through p.
static inline Moments pixel_unblend(PixelGrads* p, Moments m, Splat s, lane dx, lane dy) {
  const Coverage c = cover(s, dx, dy, p->T);
  lane gc = fma(p->vr, TO_LANE(s.c.x), fma(p->vg, TO_LANE(s.c.y), p->vb * TO_LANE(s.c.z)));
#if DEPTH
  gc = fma(p->vd, TO_LANE(s.b.z), gc);
#endif
#if FLOW
  const lane w = FLOW_WEIGHT(c, p->n);
#if !DETACH_WEIGHTS
  lane gf = fma(p->vfx, flow_x(s, c), fma(p->vfy, flow_y(s, c), p->v0));
#if TOP_K
  gf = LANE_SELECT(TO_LANE(0.f), gf, p->n < TO_LANE((float)TOP_K));
#endif
  gc += gf;
#endif
#if TOP_K
  p->n = COUNT_CONTRIBUTOR(c, p->n);
#endif
#endif
  const lane wgc = c.weight * gc;
  const lane R = p->R - wgc;
  p->R = R;
  p->T = c.T;
  lane q = wgc - R * (c.alpha / (TO_LANE(1.f) - c.alpha));
  q = LANE_SELECT(TO_LANE(0.f), q, c.raw <= TO_LANE(ALPHA_MAX));
  const lane qz1 = q * c.z1, qz2 = q * c.z2;
  m.q += q;
  m.qz1 += qz1;
  m.qz2 += qz2;
  m.qz11 = fma(qz1, c.z1, m.qz11);
  m.qz12 = fma(qz1, c.z2, m.qz12);
  m.qz22 = fma(qz2, c.z2, m.qz22);
  m.wr = fma(c.weight, p->vr, m.wr);
  m.wg = fma(c.weight, p->vg, m.wg);
  m.wb = fma(c.weight, p->vb, m.wb);
#if DEPTH
  m.wd = fma(c.weight, p->vd, m.wd);
#elif ABSGRAD
  // K^T (q z): the pixel's own pull at the mean, before pulls of other pixels cancel it.
  const lane ax = TO_LANE(s.a.z) * qz1, ay = fma(TO_LANE(s.a.w), qz1, TO_LANE(s.b.x) * qz2);
  m.wd += sqrt(fma(ax, ax, ay * ay));
#endif
#if FLOW
  const lane wx = w * p->vfx, wy = w * p->vfy;
  m.fx += wx;
  m.fy += wy;
  m.fx1 = fma(wx, c.z1, m.fx1);
  m.fx2 = fma(wx, c.z2, m.fx2);
  m.fy1 = fma(wy, c.z1, m.fy1);
  m.fy2 = fma(wy, c.z2, m.fy2);
#endif
  return m;
}

#endif
