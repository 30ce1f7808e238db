// SPDX-License-Identifier: Apache-2.0
// One Adam step of one scalar (Kingma & Ba 2015, algorithm 1) with both bias corrections:
//   m = b1 m + (1 - b1) g,  v = b2 v + (1 - b2) g^2,  x -= lr c1 m / (c2 sqrt(v) + eps)
// with c1 = 1 / (1 - b1^t) and c2 = 1 / sqrt(1 - b2^t), which the host computes in double.
// A step with gradient 0 turns v into b2 v and, if b1 = 0, does not move x. So k such steps in a
// row can be skipped and made up for by the factor b2^k when the next gradient arrives.
#ifndef GFLOW_ADAM_H
#define GFLOW_ADAM_H
#include "shared/dialect.h"

// 1 - beta is exact in float for beta in [.5, 1], so float betas lose no accuracy.
typedef struct AdamStep {
  float beta1, beta2, lr, epsilon;
} AdamStep;

typedef struct AdamState {
  real value, exp_avg, exp_avg_sq;  // x, m, v
} AdamState;

// Factors of one row's step: c1 (times the row's learning-rate scale), c2, and b1^k and b2^k for
// the k steps that the row missed.
typedef struct AdamRow {
  real correction1, correction2, decay1, decay2;
} AdamRow;

// The updated running mean, and the updated value; for scalars or vectors.
#define ADAM_MEAN(beta, decay, mean, added) ((beta) * ((decay) * (mean)) + (1 - (beta)) * (added))
#define ADAM_MOVED(value, step, c1, c2, m, v) \
  ((value) - (step).lr * (c1) * (m) / ((c2) * sqrt(v) + (step).epsilon))

static inline AdamState adam_update(AdamState s, real grad, AdamStep step, AdamRow row) {
  s.exp_avg = ADAM_MEAN(step.beta1, row.decay1, s.exp_avg, grad);
  s.exp_avg_sq = ADAM_MEAN(step.beta2, row.decay2, s.exp_avg_sq, grad * grad);
  s.value =
      ADAM_MOVED(s.value, step, row.correction1, row.correction2, s.exp_avg, s.exp_avg_sq);
  return s;
}

// Whether the gradient and its square are finite. A square that overflows would make v infinite and
// freeze the parameter for good.
static inline int is_usable_gradient(real grad) { return is_finite_real(grad * grad); }

#endif
