// SPDX-License-Identifier: Apache-2.0
// The spacetime motion model: a Gaussian on a path (Spacetime Gaussians, Li et al. 2024, with paths
// of degree 2). With tau = t - mean_t:
//   mean      mean + velocity tau + half_acceleration tau^2
//   factor    R((quat + turn tau)/|...|) diag(scales)
//   opacity   sigmoid(logit) exp(-tau^2 / (2 scale_t^2))
// With half_acceleration = turn = 0 these are exactly the 4D Gaussians of native4d.h, parametrised
// by slice and velocity: a step that changes the motion does not change the shape.
#ifndef GFLOW_SPACETIME_H
#define GFLOW_SPACETIME_H
#include "shared/motion/life.h"
#include "shared/quat.h"

// One Gaussian's parameters, as optimised.
typedef struct Spacetime {
  real3 mean;
  real mean_t;
  real3 velocity, half_acceleration;
  real4 quat, turn;  // at mean_t, not normalised; its change per unit of time
  real4 log_scales;  // x y z t
  real logit_opacity;
} Spacetime;

typedef struct SpacetimeSlice {
  real3 mean;
  Mat3 factor;
  Life life;
} SpacetimeSlice;

static inline real3 spacetime_velocity(Spacetime g, real tau) {
  return g.velocity + g.half_acceleration * ((real)2 * tau);
}

static inline SpacetimeSlice spacetime_at(Spacetime g, real t) {
  const real tau = t - g.mean_t;
  const real4 s = exp(g.log_scales);
  SpacetimeSlice o;
  o.mean = g.mean + (g.velocity + g.half_acceleration * tau) * tau;
  o.factor = factor_of(g.quat + g.turn * tau, make_real3(s.x, s.y, s.z));
  o.life = life_at(g.logit_opacity, tau, s.w * s.w);
  return o;
}

// Gradient with respect to the parameters, given that with respect to mean, factor and opacity.
static inline Spacetime spacetime_vjp(Spacetime g, real t, real3 v_mean, Mat3 v_factor,
                                      real v_opacity) {
  const real4 s = exp(g.log_scales);
  const real tau = t - g.mean_t, var = s.w * s.w;
  const real3 scales = make_real3(s.x, s.y, s.z);
  LifeGradient life = {0, 0, 0};
  if (v_opacity != 0)
    life = life_vjp(life_at(g.logit_opacity, tau, var), g.logit_opacity, tau, var, v_opacity);
  const FactorGradient factor = factor_of_vjp(g.quat + g.turn * tau, scales, v_factor);
  Spacetime v;
  v.mean = v_mean;
  v.velocity = v_mean * tau;
  v.half_acceleration = v_mean * (tau * tau);
  v.quat = factor.quat;
  v.turn = factor.quat * tau;
  v.mean_t = -(life.dt + dot(v_mean, spacetime_velocity(g, tau)) + dot(factor.quat, g.turn));
  v.log_scales = make_real4(factor.scales.x * scales.x, factor.scales.y * scales.y,
                            factor.scales.z * scales.z, (real)2 * var * life.var);
  v.logit_opacity = life.logit;
  return v;
}

#endif
