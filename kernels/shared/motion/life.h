// SPDX-License-Identifier: Apache-2.0
// Temporal opacity of a Gaussian with centre mean_t and temporal variance var, at dt = t - mean_t:
//   opacity = sigmoid(logit) exp(-dt^2 / (2 var))
#ifndef GFLOW_LIFE_H
#define GFLOW_LIFE_H
#include "shared/dialect.h"

typedef struct Life {
  real marginal;  // exp(-dt^2 / (2 var)), in [0, 1]
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

// Whether the marginal at dt exceeds exp(-sigmas^2 / 2), without evaluating it. `life` is the
// temporal standard deviation. False for NaN.
static inline int is_in_time_window(real dt, real life, real sigmas) { return fabs(dt) < sigmas * life; }

// Whether the window mean_t +- sigmas * life overlaps [0, duration]. False for NaN.
static inline int is_visible_in_video(real mean_t, real life, real duration, real sigmas) {
  const real outside = fmax(fmax(-mean_t, mean_t - duration), (real)0);
  return outside <= sigmas * life && is_finite_real(mean_t);
}

// Logit of the opacity o' of n coincident splats that together are as opaque as one of opacity o:
//   1 - o = (1 - o')^n.  With s = softplus(logit) / n: o' = 1 - exp(-s), logit' = s + log o'.
static inline real shared_opacity_logit(real logit, real n) {
  const real s = (fmax(logit, (real)0) + log1p(exp(-fabs(logit)))) / n;
  return s + log(-expm1(-s));
}
// The same for n = 2, clamped to opacities from 1e-4 to 0.999.
static inline real half_opacity_logit(real logit) {
  return clamp(shared_opacity_logit(logit, (real)2), (real)-9.2102404f, (real)6.9067548f);
}

// Learning-rate scale of a Gaussian that is visible in only a part of the video. Adam skips the
// steps in which it is not seen, so without the scale it would move less. It is
// (duration / visible time)^power, clamped to [1, most].
static inline real lifetime_rate_scale(real life, real duration, real power, real most) {
  const real seen = (real)4.9f * life;  // temporal weight above 1/20
  return clamp(pow(duration / seen, power), (real)1, most);
}

#endif
