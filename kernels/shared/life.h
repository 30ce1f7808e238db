// SPDX-License-Identifier: Apache-2.0
// A Gaussian's life: how visible it is at a time, dt away from its own, with temporal variance var.
//   opacity = sigmoid(logit) exp(-dt^2 / (2 var))
#ifndef GFLOW_LIFE_H
#define GFLOW_LIFE_H
#include "shared/dialect.h"

typedef struct Life {
  real marginal;  // the exponential, in (0, 1]
  real opacity;
} Life;
static inline Life life_at(real logit, real dt, real var) {
  Life o;
  o.marginal = exp((real)-0.5f * dt * dt / var);
  o.opacity = o.marginal / ((real)1 + exp(-logit));
  return o;
}

typedef struct LifeGradient {
  real logit, dt, var;
} LifeGradient;
static inline LifeGradient life_vjp(Life o, real logit, real dt, real var, real v_opacity) {
  const real v_exponent = v_opacity * o.opacity, relative = dt / var;
  LifeGradient v;
  v.logit = v_exponent / ((real)1 + exp(logit));  // 1 - sigmoid without cancellation
  v.dt = -v_exponent * relative;
  v.var = v_exponent * (real)0.5f * relative * relative;
  return v;
}

// The logit of the opacity o' of two splats in one place that show what one of opacity o does:
// 1 - o = (1 - o')^2.
static inline real half_opacity_logit(real logit) {
  const real opacity = (real)1 / ((real)1 + exp(-logit));
  const real half_opacity = clamp((real)1 - sqrt((real)1 - opacity), (real)1e-4f, (real)0.999f);
  return log(half_opacity / ((real)1 - half_opacity));
}

// How much faster a Gaussian should learn that is seen in a part of the video only: Adam here skips
// what is not seen, so without this it would move as much less as it is seen less.
// (length of the video / time it is seen)^power, at least 1 and at most `most`.
static inline real life_pace(real life, real duration, real power, real most) {
  const real seen = (real)4.9f * life;  // temporal weight above 1/20
  return clamp(pow(duration / seen, power), (real)1, most);
}

#endif
