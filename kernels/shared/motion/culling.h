// SPDX-License-Identifier: Apache-2.0
// Culls Gaussians that a camera cannot see, LANES at a time, before their shape at time t is
// computed (OpenCL C only). Uses mean, longest axis and opacity only. Conservative: whatever
// project_fwd (project.cl) draws passes, with margins for rounding. Motion models skip what is
// culled (Skips::outside).
#ifndef GFLOW_CULLING_H
#define GFLOW_CULLING_H
#include "shared/lane.h"
#include "shared/types.h"

// exp(x) with relative error 1e-5 for |x| <= 80; x is clamped beyond.
static inline lane cull_exp(lane x) {
  return lane_exp2(clamp(x, TO_LANE(-80.f), TO_LANE(80.f)) * 1.44269504f);
}

// With j1, j2 the rows of J W, no variance of a projected covariance J W L L^T W^T J^T + DILATION I
// exceeds (|j1|^2 + |j2|^2) longest^2 + DILATION. An opaque splat is visible within |z|^2 <= 8
// (scaled z; `reach` in project.cl). NaN passes.
static inline lane_int may_be_seen(PinholeCamera cam, lane mean_x, lane mean_y, lane mean_z,
                                   lane longest, lane opacity) {
  const lane zero = TO_LANE(0.f);
  const lane px = fma(TO_LANE(cam.rotation[0]), mean_x,
                      fma(TO_LANE(cam.rotation[1]), mean_y,
                          fma(TO_LANE(cam.rotation[2]), mean_z, TO_LANE(cam.translation[0]))));
  const lane py = fma(TO_LANE(cam.rotation[3]), mean_x,
                      fma(TO_LANE(cam.rotation[4]), mean_y,
                          fma(TO_LANE(cam.rotation[5]), mean_z, TO_LANE(cam.translation[1]))));
  const lane pz = fma(TO_LANE(cam.rotation[6]), mean_x,
                      fma(TO_LANE(cam.rotation[7]), mean_y,
                          fma(TO_LANE(cam.rotation[8]), mean_z, TO_LANE(cam.translation[2]))));
  const lane inv_z = 1.f / pz, x = px * inv_z, y = py * inv_z;
  // project() clamps J at FOV_MARGIN outside the image.
  const float width = (float)(cam.full_width ? cam.full_width : cam.width);
  const float height = (float)(cam.full_height ? cam.full_height : cam.height);
  const float far_x = (fmax(cam.cx, width - cam.cx) + FOV_MARGIN * 0.5f * width) / cam.fx;
  const float far_y = (fmax(cam.cy, height - cam.cy) + FOV_MARGIN * 0.5f * height) / cam.fy;
  const lane u = fmin(fabs(x), TO_LANE(fabs(far_x))), v = fmin(fabs(y), TO_LANE(fabs(far_y)));
  const lane along =
      cam.fx * cam.fx * fma(u, u, TO_LANE(1.f)) + cam.fy * cam.fy * fma(v, v, TO_LANE(1.f));
  const lane size = longest * inv_z;
  const lane variance = fma(1.01f * along, size * size, TO_LANE(DILATION));
  const lane reach = sqrt((8.1f / HALF_LOG2_E) * variance);
  const lane left = fma(TO_LANE(cam.fx), x, TO_LANE(cam.cx - cam.left));
  const lane top = fma(TO_LANE(cam.fy), y, TO_LANE(cam.cy - cam.top));
  const lane_int fails = (opacity < TO_LANE(0.0039f)) |  // 1/255
                         (pz < TO_LANE(cam.near_plane * 0.9999f)) | (left + reach < zero) |
                         (left - reach > TO_LANE((float)cam.width)) | (top + reach < zero) |
                         (top - reach > TO_LANE((float)cam.height));
  return !fails;
}

// LANES values as one vector or one by one.
typedef union LaneFloats {
  lane all;
  float row[LANES];
} LaneFloats;
typedef union LaneInts {
  lane_int all;
  int row[LANES];
} LaneInts;

// Stores one bit per visible row of the LANES rows of `group`, and their number. Ignores rows >= n.
static inline void cull_mark(uint group, uint n, LaneInts shown, global uint* restrict marks,
                             global uint* restrict counts) {
  uint mark = 0;
  if (lane_any(shown.all)) {
    const uint count = min((uint)LANES, n - group * LANES);
    for (uint r = 0; r < count; ++r) mark |= (uint)(shown.row[r] != 0) << r;
  }
  marks[group] = mark;
  counts[group] = popcount(mark);
}

// Column `column` of LANES rows, from `first` on, of an array [n, width]; its last row stands in
// for rows beyond the end.
static inline lane cull_column(global const float* restrict values, uint first, uint n, uint width,
                               uint column) {
#define CULL_ROW(r) values[(size_t)min(first + r, n - 1) * width + column]
#if LANES == 16
  return (lane)(CULL_ROW(0), CULL_ROW(1), CULL_ROW(2), CULL_ROW(3), CULL_ROW(4), CULL_ROW(5),
                CULL_ROW(6), CULL_ROW(7), CULL_ROW(8), CULL_ROW(9), CULL_ROW(10), CULL_ROW(11),
                CULL_ROW(12), CULL_ROW(13), CULL_ROW(14), CULL_ROW(15));
#elif LANES == 8
  return (lane)(CULL_ROW(0), CULL_ROW(1), CULL_ROW(2), CULL_ROW(3), CULL_ROW(4), CULL_ROW(5),
                CULL_ROW(6), CULL_ROW(7));
#elif LANES == 4
  return (lane)(CULL_ROW(0), CULL_ROW(1), CULL_ROW(2), CULL_ROW(3));
#else
  return CULL_ROW(0);
#endif
}

// What culling reads of Gaussians with temporal opacity as in shared/motion/life.h and one scale
// per axis. cull_time loads the times; the other members are needed only if one of the rows is
// inside its time window. Rows are in the order of time (optim/density/order.hpp), so most groups
// of a long video need no more.
typedef struct CullInputs {
  LaneFloats x, y, z;  // mean
  LaneFloats dt;       // t - mean_t
  LaneFloats log_life, log_longest, logit;
} CullInputs;

// Rows less than `sigmas` temporal standard deviations away, with a rounding margin. NaN passes.
static inline lane_int cull_in_time_window(lane dt, lane log_life, float sigmas) {
  return !(fabs(dt) > TO_LANE(1.001f * sigmas) * cull_exp(log_life));
}

// Loads the times of LANES rows and tests them. The other members stay undefined.
static inline lane_int cull_time(CullInputs* o, uint first, uint n, float t, float sigmas,
                                 global const float* means_t, global const float* log_scales) {
  o->dt.all = t - cull_column(means_t, first, n, 1, 0);
  o->log_life.all = cull_column(log_scales, first, n, 4, 3);
  return cull_in_time_window(o->dt.all, o->log_life.all, sigmas);
}

// To be called before cull_put: defines the lanes that no row fills.
static inline void cull_clear(CullInputs* o) {
  o->x.all = o->y.all = o->z.all = TO_LANE(0.f);
  o->log_longest.all = o->logit.all = TO_LANE(0.f);
}
static inline void cull_put(CullInputs* o, uint r, float3 mean, float4 log_scales, float logit) {
  const float xy = log_scales.x > log_scales.y ? log_scales.x : log_scales.y;
  o->x.row[r] = mean.x;
  o->y.row[r] = mean.y;
  o->z.row[r] = mean.z;
  o->log_longest.row[r] = xy > log_scales.z ? xy : log_scales.z;
  o->logit.row[r] = logit;
}

// Rows that the camera may see.
static inline lane_int cull_visible(CullInputs o, PinholeCamera camera) {
  const lane apart = o.dt.all / cull_exp(o.log_life.all);
  const lane opacity = cull_exp(-0.5f * apart * apart) / (TO_LANE(1.f) + cull_exp(-o.logit.all));
  return may_be_seen(camera, o.x.all, o.y.all, o.z.all, cull_exp(o.log_longest.all), opacity);
}

#endif
