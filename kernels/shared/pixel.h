// SPDX-License-Identifier: Apache-2.0
// What one splat adds to LANES pixels, and the gradient (OpenCL C only). Forward and backward run
// the same visibility test on the same bits, and backward starts where each pixel's forward pass
// ended, so they agree on every contributor.
//
// Defines: FLOW, DEPTH 0|1. TOP_K 0: all contributors make the flow; K: the first K in depth order
// (the paper's K = 20). EXCLUDE 0: the splat that saturates a pixel is drawn, then the pixel stops;
// 1: the pixel stops before it, as in 3DGS.
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
#ifndef SATURATED
#define SATURATED 1  // 0: a tile's list is processed to its end (Skips::saturated)
#endif
#ifndef DETACH_WEIGHTS
#define DETACH_WEIGHTS 0  // 1: no flow gradient to the blending weights, only to each splat's flow
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
  global const float* p = splats + 16 * (size_t)i;
  Splat s;
  s.a = (float4)(p[0], p[1], p[2], p[3]);
  s.b = (float4)(p[4], p[5], p[6], p[7]);
  s.c = (float4)(p[8], p[9], p[10], p[11]);
  s.d = (float4)(p[12], p[13], p[14], p[15]);
  return s;
}

// Pixels relative to a splat: z = K (x - mean), and the splat's alpha there, whatever is in front
// of it, before the clamp at ALPHA_MAX; 0 below ALPHA_MIN.
typedef struct Footprint {
  lane z1, z2, raw;
} Footprint;

static inline Footprint footprint_at(Splat s, lane z1, lane z2) {
  Footprint p;
  const lane e = fma(-z1, z1, fma(-z2, z2, TO_LANE(s.b.y)));
  p.z1 = z1;
  p.z2 = z2;
  p.raw = LANE_SELECT(TO_LANE(0.f), lane_exp2(e), e >= TO_LANE(ALPHA_MIN_LOG2));
  return p;
}

#if LANES == 1
static inline Footprint footprint(Splat s, float dx, float dy) {
  return footprint_at(s, fma(s.a.z, dx, s.a.w * dy), s.b.x * dy);
}
#else
// z over a tile, split into an offset per lane of a cell and one per cell centre: a lane vector's z
// is then one addition of a scalar from memory.
typedef struct TileFrame {
  lane z1[CELL_PARTS], z2[CELL_PARTS];
  union {
    float16 all;
    float cell[16];
  } at_z1, at_z2;
} TileFrame;

#define CENTRE_X ((float16)(2, 6, 10, 14, 2, 6, 10, 14, 2, 6, 10, 14, 2, 6, 10, 14))
#define CENTRE_Y ((float16)(2, 2, 2, 2, 6, 6, 6, 6, 10, 10, 10, 10, 14, 14, 14, 14))

static inline TileFrame tile_frame(Splat s, int x0, int y0) {
  TileFrame f;
#pragma unroll  // as loops, the parts went through memory: slower with 8 lanes
  for (int part = 0; part < CELL_PARTS; ++part) {
    const lane dx = LANE_X - TO_LANE(2.f), dy = LANE_Y + TO_LANE((float)(part * LANE_ROWS) - 2.f);
    f.z1[part] = fma(TO_LANE(s.a.z), dx, TO_LANE(s.a.w) * dy);
    f.z2[part] = TO_LANE(s.b.x) * dy;
  }
  const float16 dx = CENTRE_X + (float16)((float)x0 - s.a.x);
  const float16 dy = CENTRE_Y + (float16)((float)y0 - s.a.y);
  f.at_z1.all = fma((float16)(s.a.z), dx, (float16)(s.a.w) * dy);
  f.at_z2.all = (float16)(s.b.x) * dy;
  return f;
}

typedef struct CellFootprint {
  Footprint part[CELL_PARTS];
} CellFootprint;

static inline CellFootprint cell_footprint(Splat s, const TileFrame* f, int cell) {
  CellFootprint c;
#pragma unroll
  for (int part = 0; part < CELL_PARTS; ++part)
    c.part[part] = footprint_at(s, f->z1[part] + TO_LANE(f->at_z1.cell[cell]),
                                f->z2[part] + TO_LANE(f->at_z2.cell[cell]));
  return c;
}

// Removes a cell from a mask that is not empty, and returns it.
static inline int next_cell(uint* mask) {
  const int cell = 31 - clz(*mask);
  *mask ^= 1u << cell;
  return cell;
}
#endif

// How much of the pixels' colour the splat contributes.
typedef struct Coverage {
  lane_int open;  // whether the pixel still takes splats
  lane alpha;     // 0 where the splat does not contribute
  lane weight;    // T alpha
  lane T;         // transmittance behind the splat; with EXCLUDE the sign marks a finished pixel
} Coverage;

// T alpha and the new T are each rounded once. T - (T alpha) would have the 1/(1 - alpha)-fold
// error.
static inline Coverage cover(Footprint p, lane T) {
  Coverage c;
  const lane cut = fmin(p.raw, TO_LANE(ALPHA_MAX));
#if EXCLUDE
  const lane_int met = (p.raw > TO_LANE(0.f)) & (T > TO_LANE(0.f));
  c.open = met & (fma(-T, cut, T) >= TO_LANE(T_MIN));
  c.alpha = LANE_SELECT(TO_LANE(0.f), cut, c.open);
  c.T = LANE_SELECT(fma(-T, c.alpha, T), -T, met & ~c.open);
#else
  c.open = T >= TO_LANE(T_MIN);
  c.alpha = LANE_SELECT(TO_LANE(0.f), cut, c.open);
  c.T = fma(-T, c.alpha, T);
#endif
  c.weight = T * c.alpha;
  return c;
}
// Whether a pixel still takes splats.
static inline lane_int still_open(lane T) {
  return EXCLUDE ? T > TO_LANE(0.f) : T >= TO_LANE(T_MIN);
}
static inline lane flow_x(Splat s, Footprint p) {
  return fma(TO_LANE(s.d.x), p.z1, fma(TO_LANE(s.d.y), p.z2, TO_LANE(s.b.w)));
}
static inline lane flow_y(Splat s, Footprint p) {
  return fma(TO_LANE(s.d.z), p.z1, fma(TO_LANE(s.d.w), p.z2, TO_LANE(s.c.w)));
}

// ---- forward: the sums of one lane vector
typedef struct PixelSums {
  lane T, W, r, g, b;  // W: sum of weights; 1 - T is inaccurate where W is small
  lane_int end;        // entries of the tile's list until the pixel is saturated
#if DEPTH
  lane depth;
#endif
#if FLOW
  lane fx, fy;
#endif
#if TOP_K
  lane n, W_flow;     // contributors so far; the weights of the first TOP_K
  lane_int flow_end;  // entries until TOP_K have contributed
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
  s.flow_end = (lane_int)(0);
#endif
  s.end = (lane_int)(0);
  return s;
}
// `entry` counts the tile's list from 1.
static inline PixelSums pixel_blend(PixelSums p, Splat s, Footprint at, int entry) {
  const Coverage c = cover(at, p.T);
  p.T = c.T;
  p.end = LANE_SELECT(p.end, (lane_int)(entry), c.open);
  p.W += c.weight;
  p.r = fma(c.weight, TO_LANE(s.c.x), p.r);
  p.g = fma(c.weight, TO_LANE(s.c.y), p.g);
  p.b = fma(c.weight, TO_LANE(s.c.z), p.b);
#if DEPTH
  p.depth = fma(c.weight, TO_LANE(s.b.z), p.depth);
#endif
#if FLOW
#if TOP_K
  const lane_int among_first = p.n < TO_LANE((float)TOP_K);
  const lane w = LANE_SELECT(TO_LANE(0.f), c.weight, among_first);
  p.W_flow += w;
  p.n = LANE_SELECT(p.n, p.n + TO_LANE(1.f), c.alpha > TO_LANE(0.f));
  p.flow_end = LANE_SELECT(p.flow_end, (lane_int)(entry), among_first);
#else
  const lane w = c.weight;
#endif
  p.fx = fma(w, flow_x(s, at), p.fx);
  p.fy = fma(w, flow_y(s, at), p.fy);
#endif
  return p;
}

// ---- backward: back to front, with R the part of v . output from behind
//   dL/d(exponent) = ln 2 (w gc - R alpha/(1 - alpha)),  gc = gradient w.r.t. this weight
// R is summed from behind. As the image minus what is in front it would have, behind an alpha of
// .99, a hundred times the image's rounding error (`gflow stress`, T16).
typedef struct PixelGrads {
  lane T, R;
  lane_int end;  // as in PixelSums
  lane vr, vg, vb;
#if DEPTH
  lane vd;
#endif
#if FLOW
  lane vfx, vfy;  // v_flow / W
  lane v0;        // part of every flow weight's gradient: -(v_flow . flow)/W
#endif
#if TOP_K
  lane_int flow_end;
#endif
} PixelGrads;

// The 16 sums of one splat, per lane, with q = v_exponent / ln 2.
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

// 1 / x for x in [.01, 1], to half an ulp even where OpenCL's 2.5 are used: a pixel's T is divided
// once per layer, so errors add up (`gflow stress`, T16). One Newton step, 2 operations; exact
// quotients by the compiler cost more (NVIDIA H100).
static inline lane reciprocal(lane x) {
  const lane r = TO_LANE(1.f) / x;
#if LANES == 1
  return fma(r, fma(-x, r, 1.f), r);
#else
  return r;  // CPUs divide exactly
#endif
}

// Adds the splat's moments in these pixels to m and updates the pixels' state. `entry` as above.
static inline Moments pixel_unblend(PixelGrads* p, Moments m, Splat s, Footprint at, int entry) {
  const lane zero = TO_LANE(0.f), cut = fmin(at.raw, TO_LANE(ALPHA_MAX));
  const lane alpha = LANE_SELECT(zero, cut, (lane_int)(entry) <= p->end);
  const lane by_passing = reciprocal(TO_LANE(1.f) - alpha);
  const lane T = p->T * by_passing, weight = T * alpha;
  lane gc = fma(p->vr, TO_LANE(s.c.x), fma(p->vg, TO_LANE(s.c.y), p->vb * TO_LANE(s.c.z)));
#if DEPTH
  gc = fma(p->vd, TO_LANE(s.b.z), gc);
#endif
#if FLOW
#if TOP_K
  const lane_int among_first = (lane_int)(entry) <= p->flow_end;
  const lane w = LANE_SELECT(zero, weight, among_first);
#else
  const lane w = weight;
#endif
#if !DETACH_WEIGHTS
  lane gf = fma(p->vfx, flow_x(s, at), fma(p->vfy, flow_y(s, at), p->v0));
#if TOP_K
  gf = LANE_SELECT(zero, gf, among_first);
#endif
  gc += gf;
#endif
#endif
  const lane wgc = weight * gc;
  lane q = wgc - p->R * (alpha * by_passing);
  p->R += wgc;
  p->T = T;
  q = LANE_SELECT(zero, q, at.raw <= TO_LANE(ALPHA_MAX));
  const lane qz1 = q * at.z1, qz2 = q * at.z2;
  m.q += q;
  m.qz1 += qz1;
  m.qz2 += qz2;
  m.qz11 = fma(qz1, at.z1, m.qz11);
  m.qz12 = fma(qz1, at.z2, m.qz12);
  m.qz22 = fma(qz2, at.z2, m.qz22);
  m.wr = fma(weight, p->vr, m.wr);
  m.wg = fma(weight, p->vg, m.wg);
  m.wb = fma(weight, p->vb, m.wb);
#if DEPTH
  m.wd = fma(weight, p->vd, m.wd);
#elif ABSGRAD
  // K^T (q z): this pixel's gradient of the mean, before those of other pixels cancel it
  const lane ax = TO_LANE(s.a.z) * qz1, ay = fma(TO_LANE(s.a.w), qz1, TO_LANE(s.b.x) * qz2);
  m.wd += sqrt(fma(ax, ax, ay * ay));
#endif
#if FLOW
  const lane wx = w * p->vfx, wy = w * p->vfy;
  m.fx += wx;
  m.fy += wy;
  m.fx1 = fma(wx, at.z1, m.fx1);
  m.fx2 = fma(wx, at.z2, m.fx2);
  m.fy1 = fma(wy, at.z1, m.fy1);
  m.fy2 = fma(wy, at.z2, m.fy2);
#endif
  return m;
}

#endif
