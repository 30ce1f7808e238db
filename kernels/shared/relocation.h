// SPDX-License-Identifier: Apache-2.0
// Replaces one Gaussian by n coincident ones (Kheradmand et al. 2024, "3D Gaussian Splatting as
// Markov Chain Monte Carlo", eq. 9). For opacity o, n of opacity x with 1 - o = (1 - x)^n
// (shared_opacity_logit) keep the opacity at the centre. Scaling their size by o / S also keeps the
// opacity summed along a line through the centre:
//   S = sum_{i=1}^{n} sum_{k=0}^{i-1} C(i-1, k) (-1)^k x^(k+1) / sqrt(k+1).
// The alternating sum loses its digits as n grows. Since 1/sqrt(k+1) =
// 1/sqrt(pi) int exp(-(k+1)u^2) du, it equals
//   S = 1/sqrt(pi) int 1 - (1 - x exp(-u^2))^n du,
// whose integrand is positive, so nothing cancels for any n.
#ifndef GFLOW_RELOCATION_H
#define GFLOW_RELOCATION_H
#include "shared/motion/life.h"

// The scale o / S, given the logit of o: 1 for n = 1, less for more. Trapezoidal rule of step 1/8
// up to |u| = 5, where the integrand is below n 1e-11: relative error below 1e-6 for n up to 1000.
static inline real shared_scale(real logit, real n) {
  const real opacity = (real)1 / ((real)1 + exp(-logit));
  const real x = (real)1 / ((real)1 + exp(-shared_opacity_logit(logit, n)));
  real sum = (real)0.5f * opacity;  // u = 0: the n together have opacity o
  for (int k = 1; k <= 40; ++k) {
    const real u = (real)k * (real)0.125f;
    sum -= expm1(n * log1p(-x * exp(-u * u)));
  }
  return opacity / (sum * (real)(0.25f * 0.564189584f));  // 2 h / sqrt(pi)
}

#endif
