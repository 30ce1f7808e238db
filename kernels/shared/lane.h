// SPDX-License-Identifier: Apache-2.0
// The lane type of pixel maths (OpenCL C only): LANES pixels of one 4x4 cell at once.
//   LANES 16, 8, 4   CPUs: one work-item per tile, floatN holds 4x4, 4x2 or 4x1 pixels
//   LANES 1          GPUs: one work-item per pixel, 16 consecutive work-items are a cell
// Do not use any(), all(), rint() or floor() on wide vectors: PoCL takes them apart into scalars.
#ifndef GFLOW_LANE_H
#define GFLOW_LANE_H
#include "shared/constants.h"
#include "shared/dialect.h"

#ifndef LANES
#define LANES 16  // only for the syntax check; the host always defines it
#endif
#define LANE_JOIN2(a, b) a##b
#define LANE_JOIN(a, b) LANE_JOIN2(a, b)
#if LANES == 1
typedef float lane;
typedef int lane_int;
#define TO_LANE(x) (x)
#define LANE_AS_INT as_int
#define LANE_AS_FLOAT as_float
#define LANE_TO_INT convert_int
#define LANE_FROM_INT convert_float
#define LANE_SELECT(no, yes, mask) ((mask) ? (yes) : (no))
#else
typedef LANE_JOIN(float, LANES) lane;
typedef LANE_JOIN(int, LANES) lane_int;
#define TO_LANE(x) ((lane)(x))
#define LANE_AS_INT LANE_JOIN(as_int, LANES)
#define LANE_AS_FLOAT LANE_JOIN(as_float, LANES)
#define LANE_TO_INT LANE_JOIN(convert_int, LANES)
#define LANE_FROM_INT LANE_JOIN(convert_float, LANES)
#define LANE_SELECT(no, yes, mask) select((no), (yes), (mask))
#endif

// Prefetches memory that will be read, or written, some iterations later: on CPUs, records
// scattered in memory take longer to fetch than to process. OpenCL's prefetch() is empty on PoCL.
#if LANES > 1 && (defined(__x86_64__) || defined(__aarch64__))
#define READ_SOON(pointer) __builtin_prefetch((const void*)(size_t)(pointer))
#define WRITE_SOON(pointer) __builtin_prefetch((const void*)(size_t)(pointer), 1)
#else
#define READ_SOON(pointer) (void)(pointer)
#define WRITE_SOON(pointer) (void)(pointer)
#endif

// The lanes' pixel centres within their part of a cell, and the parts of a cell.
#if LANES == 16
#define LANE_X ((lane)((float4)(.5f, 1.5f, 2.5f, 3.5f), (float4)(.5f, 1.5f, 2.5f, 3.5f), \
                       (float4)(.5f, 1.5f, 2.5f, 3.5f), (float4)(.5f, 1.5f, 2.5f, 3.5f)))
#define LANE_Y ((lane)((float4)(.5f), (float4)(1.5f), (float4)(2.5f), (float4)(3.5f)))
#elif LANES == 8
#define LANE_X ((lane)(.5f, 1.5f, 2.5f, 3.5f, .5f, 1.5f, 2.5f, 3.5f))
#define LANE_Y ((lane)(.5f, .5f, .5f, .5f, 1.5f, 1.5f, 1.5f, 1.5f))
#elif LANES == 4
#define LANE_X ((lane)(.5f, 1.5f, 2.5f, 3.5f))
#define LANE_Y ((lane)(.5f))
#endif
#if LANES > 1
#define LANE_ROWS (LANES / CELL)       // pixel rows in one lane vector
#define CELL_PARTS (CELL / LANE_ROWS)  // lane vectors in one cell
#define TILE_PARTS (16 * CELL_PARTS)   // lane vectors in one tile
#endif

// 2^x for -126 <= x <= 126. Below, the result is meaningless and must be masked by the caller, as
// pixel maths masks everything under ALPHA_MIN. Minimax polynomial on [-.5, .5], of degree 5 with
// relative error 2e-7. Rounds by adding 1.5 * 2^23, after which the lowest bits are round(x). Both
// are faster than exp2(), native_exp2() and conversions on PoCL.
static inline lane lane_exp2(lane x) {
  const lane magic = TO_LANE(12582912.f), rounded = x + magic;
  const lane f = x - (rounded - magic);
  lane p = fma(TO_LANE(0.00132764722f), f, TO_LANE(0.00967554162f));
  p = fma(p, f, TO_LANE(0.0555071328f));
  p = fma(p, f, TO_LANE(0.240221197f));
  p = fma(p, f, TO_LANE(0.693146967f));
  p = fma(p, f, TO_LANE(1.00000007f));
  return LANE_AS_FLOAT(LANE_AS_INT(p) + (LANE_AS_INT(rounded) << 23));
}

#if LANES == 1
static inline int lane_any(lane_int a) { return a; }
#else
// Sum over the lanes, in a fixed order.
#if LANES == 16
static inline float lane_sum(lane a) {
  const float8 b = a.lo + a.hi;
  const float4 c = b.lo + b.hi;
  const float2 d = c.lo + c.hi;
  return d.x + d.y;
}
static inline int lane_any(lane_int a) {
  const int8 b = a.lo | a.hi;
  const int4 c = b.lo | b.hi;
  const int2 d = c.lo | c.hi;
  return d.x | d.y;
}
#elif LANES == 8
static inline float lane_sum(lane a) {
  const float4 c = a.lo + a.hi;
  const float2 d = c.lo + c.hi;
  return d.x + d.y;
}
static inline int lane_any(lane_int a) {
  const int4 c = a.lo | a.hi;
  const int2 d = c.lo | c.hi;
  return d.x | d.y;
}
#else
static inline float lane_sum(lane a) {
  const float2 d = a.lo + a.hi;
  return d.x + d.y;
}
static inline int lane_any(lane_int a) {
  const int2 d = a.lo | a.hi;
  return d.x | d.y;
}
#endif

// One lane vector of the plane [height, width] with its top left pixel at (x, y). Pixels outside
// the image read as 0 and are not written.
static inline lane lane_load(global const float* plane, int x, int y, int width, int height) {
  if (x + CELL <= width && y + LANE_ROWS <= height) {
    global const float* p = plane + (size_t)y * width + x;
#if LANES == 16
    return (lane)(vload4(0, p), vload4(0, p + width), vload4(0, p + 2 * width),
                  vload4(0, p + 3 * width));
#elif LANES == 8
    return (lane)(vload4(0, p), vload4(0, p + width));
#else
    return vload4(0, p);
#endif
  }
  union {
    lane v;
    float f[LANES];
  } u;
  for (int i = 0; i < LANES; ++i) {
    const int px = x + i % CELL, py = y + i / CELL;
    u.f[i] = px < width && py < height ? plane[(size_t)py * width + px] : 0.f;
  }
  return u.v;
}
static inline void lane_store(lane v, global float* plane, int x, int y, int width, int height) {
  if (x + CELL <= width && y + LANE_ROWS <= height) {
    global float* p = plane + (size_t)y * width + x;
#if LANES == 16
    vstore4(v.s0123, 0, p);
    vstore4(v.s4567, 0, p + width);
    vstore4(v.s89ab, 0, p + 2 * width);
    vstore4(v.scdef, 0, p + 3 * width);
#elif LANES == 8
    vstore4(v.lo, 0, p);
    vstore4(v.hi, 0, p + width);
#else
    vstore4(v, 0, p);
#endif
    return;
  }
  union {
    lane v;
    float f[LANES];
  } u;
  u.v = v;
  for (int i = 0; i < LANES; ++i) {
    const int px = x + i % CELL, py = y + i / CELL;
    if (px < width && py < height) plane[(size_t)py * width + px] = u.f[i];
  }
}
static inline int lane_max_int(lane_int a) {
  union {
    lane_int v;
    int i[LANES];
  } u;
  u.v = a;
  int most = u.i[0];
  for (int i = 1; i < LANES; ++i) most = max(most, u.i[i]);
  return most;
}

// Planes of integers.
static inline lane_int lane_load_int(global const int* plane, int x, int y, int width, int height) {
  return LANE_AS_INT(lane_load((global const float*)plane, x, y, width, height));
}
static inline void lane_store_int(lane_int v, global int* plane, int x, int y, int width,
                                  int height) {
  lane_store(LANE_AS_FLOAT(v), (global float*)plane, x, y, width, height);
}
#endif

#endif
