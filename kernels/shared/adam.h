// SPDX-License-Identifier: Apache-2.0
// One Adam step for one scalar (Kingma & Ba 2015, algorithm 1), both bias corrections included:
//   m = b1 m + (1 - b1) g,  v = b2 v + (1 - b2) g^2,  x -= lr c1 m / (c2 sqrt(v) + eps)
// with c1 = 1 / (1 - b1^t), c2 = 1 / sqrt(1 - b2^t), which the host computes in double.
#ifndef GFLOW_ADAM_H
#define GFLOW_ADAM_H
#include "shared/dialect.h"

// 1 - beta is exact in float for beta in [.5, 1], so float betas lose nothing.
typedef struct AdamStep {
  float beta1, beta2, lr, epsilon;
} AdamStep;

typedef struct AdamState {
  real value, exp_avg, exp_avg_sq;  // x, m, v
} AdamState;

static inline AdamState adam_update(AdamState s, real grad, AdamStep step, real correction1,
                                    real correction2) {
  s.exp_avg = step.beta1 * s.exp_avg + (1 - step.beta1) * grad;
  s.exp_avg_sq = step.beta2 * s.exp_avg_sq + (1 - step.beta2) * (grad * grad);
  s.value -= step.lr * correction1 * s.exp_avg / (correction2 * sqrt(s.exp_avg_sq) + step.epsilon);
  return s;
}

// Whether Adam can take this gradient: it and its square are finite. A square that overflows would
// make v infinite and stop the parameter for good.
static inline int adam_accepts(real grad) { return is_finite_real(grad * grad); }

#endif
