// SPDX-License-Identifier: Apache-2.0
// A canonical Gaussian, shifted by a motion model and seen at time t:
//   mean      mean + shift          factor    R((quat + shift)/|...|) diag(exp(log_scales + shift))
//   opacity   sigmoid(logit) exp(-(t - mean_t)^2 / (2 scale_t^2))
#ifndef GFLOW_SHIFTED_H
#define GFLOW_SHIFTED_H
#include "shared/motion/life.h"
#include "shared/quat.h"

// The canonical parameters.
typedef struct Canonical {
  real3 mean;
  real mean_t;
  real4 quat;
  real4 log_scales;  // x y z t
  real logit_opacity;
} Canonical;

typedef struct Shift {
  real3 mean;
  real4 quat;
  real3 log_scales;
} Shift;
static inline Shift no_shift(void) {
  Shift d;
  d.mean = d.log_scales = make_real3(0, 0, 0);
  d.quat = make_real4(0, 0, 0, 0);
  return d;
}

typedef struct Shifted {
  real3 mean;
  Mat3 factor;
  Life life;
} Shifted;

static inline real3 shifted_scales(Canonical g, Shift d) {
  return make_real3(exp(g.log_scales.x + d.log_scales.x), exp(g.log_scales.y + d.log_scales.y),
                    exp(g.log_scales.z + d.log_scales.z));
}

static inline Shifted shifted_at(Canonical g, Shift d, real t) {
  Shifted o;
  o.mean = g.mean + d.mean;
  o.factor = factor_of(g.quat + d.quat, shifted_scales(g, d));
  o.life = life_at(g.logit_opacity, t - g.mean_t, exp((real)2 * g.log_scales.w));
  return o;
}

// Gradient with respect to the canonical parameters; its mean, quat and log_scales.xyz are also
// those with respect to the shift.
static inline Canonical shifted_vjp(Canonical g, Shift d, real t, real3 v_mean, Mat3 v_factor,
                                    real v_opacity) {
  const real dt = t - g.mean_t, var = exp((real)2 * g.log_scales.w);
  const real3 scales = shifted_scales(g, d);
  const LifeGradient life =
      life_vjp(life_at(g.logit_opacity, dt, var), g.logit_opacity, dt, var, v_opacity);
  const FactorGradient factor = factor_of_vjp(g.quat + d.quat, scales, v_factor);
  Canonical v;
  v.mean = v_mean;
  v.mean_t = -life.dt;
  v.quat = factor.quat;
  v.log_scales = make_real4(factor.scales.x * scales.x, factor.scales.y * scales.y,
                            factor.scales.z * scales.z, (real)2 * var * life.var);
  v.logit_opacity = life.logit;
  return v;
}

#endif
