// SPDX-License-Identifier: Apache-2.0
// One Adam step for one scalar (Kingma & Ba 2015, algorithm 1), both bias corrections included:
//   m = b1 m + (1 - b1) g,  v = b2 v + (1 - b2) g^2,  x -= lr c1 m / (c2 sqrt(v) + eps)
// with c1 = 1 / (1 - b1^t), c2 = 1 / sqrt(1 - b2^t), which the host computes in double.
// A step of gradient 0 makes b2 v of v. Of k such steps in a row b2^k v comes, and with b1 = 0 they
// move nothing: so they can be left out, and made up for by one product when a gradient comes.
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

// What a row's history does to its step: c1 (times what else multiplies its rate), c2, and b1^k and
// b2^k for the k steps that it missed.
typedef struct AdamRow {
  real correction1, correction2, decay1, decay2;
} AdamRow;

// A mean with one more in it, and a value moved; of one number or of a vector of them.
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

// Whether Adam can take this gradient: it and its square are finite. A square that overflows would
// make v infinite and stop the parameter for good.
static inline int adam_accepts(real grad) { return is_finite_real(grad * grad); }

#endif
