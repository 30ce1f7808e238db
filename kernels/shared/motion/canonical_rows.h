// SPDX-License-Identifier: Apache-2.0
// Loads and stores the arrays of canonical parameters, one Gaussian at a time (OpenCL C only).
#ifndef GFLOW_CANONICAL_ROWS_H
#define GFLOW_CANONICAL_ROWS_H
#include "shared/arrays.h"
#include "shared/motion/shifted.h"
#include "shared/view_rows.h"

#define CANONICAL_IN                                                               \
  global const float* restrict means, global const float* restrict means_t,        \
      global const float* restrict quats, global const float* restrict log_scales, \
      global const float* restrict logit_opacities
#define CANONICAL_ROWS means, means_t, quats, log_scales, logit_opacities

#define V_CANONICAL_OUT                                                    \
  global float* restrict v_means, global float* restrict v_means_t,        \
      global float* restrict v_quats, global float* restrict v_log_scales, \
      global float* restrict v_logit_opacities
#define V_CANONICAL_ROWS v_means, v_means_t, v_quats, v_log_scales, v_logit_opacities

static inline Canonical load_canonical(uint i, CANONICAL_IN) {
  Canonical g;
  g.mean = load3(means, i);
  g.mean_t = means_t[i];
  g.quat = load4(quats, i);
  g.log_scales = load4(log_scales, i);
  g.logit_opacity = logit_opacities[i];
  return g;
}

// Whether row i, entry k of the view, is needed at time t: at the first time, if it is inside its
// time window (else its opacity becomes 0); at a second time, if it touches a tile.
static inline int canonical_in_window(uint i, uint k, float t, float sigmas, int first,
                                      global const uint* restrict tiles_touched,
                                      global const float* restrict means_t,
                                      global const float* restrict log_scales,
                                      global float* restrict opacities_at) {
  if (!first) return tiles_touched[k] != 0;
  if (is_in_time_window(t - means_t[i], exp(log_scales[4 * i + 3]), sigmas)) return 1;
  opacities_at[k] = 0.f;
  return 0;
}

// Writes entry k of the view.
static inline void store_shifted(uint k, Shifted o, global float* restrict means_at,
                                 global float* restrict factors_at,
                                 global float* restrict opacities_at) {
  opacities_at[k] = o.life.opacity;
  store3(means_at, k, o.mean);
  store_mat3(factors_at, k, o.factor);
}

// Sets the gradients if `fresh`, else adds to them.
static inline void put_canonical(uint i, Canonical v, int fresh, V_CANONICAL_OUT) {
  if (fresh) {
    store3(v_means, i, v.mean);
    v_means_t[i] = v.mean_t;
    vstore4(v.quat, i, v_quats);
    vstore4(v.log_scales, i, v_log_scales);
    v_logit_opacities[i] = v.logit_opacity;
    return;
  }
  add3(v_means, i, v.mean);
  v_means_t[i] += v.mean_t;
  add4(v_quats, i, v.quat);
  add4(v_log_scales, i, v.log_scales);
  v_logit_opacities[i] += v.logit_opacity;
}

#endif
