// SPDX-License-Identifier: Apache-2.0
// Many Gaussians in the place of one (Kheradmand et al. 2024, "3D Gaussian Splatting as Markov
// Chain Monte Carlo", eq. 9): n equal ones of opacity x, with 1 - o = (1 - x)^n
// (shared_opacity_logit), show in their middle what one of opacity o did, and along a line through
// it as much in all when their size is the old one times o / S,
//   S = sum_{i=1}^{n} sum_{k=0}^{i-1} C(i-1, k) (-1)^k x^(k+1) / sqrt(k+1).
// That alternating sum loses its digits as n grows. With 1/sqrt(k+1) = 1/sqrt(pi) int exp(-(k+1)
// u^2) du it is, term by term, the opacity of n Gaussians along a line,
//   S = 1/sqrt(pi) int 1 - (1 - x exp(-u^2))^n du,
// of positive terms only, and needs no limit on n.
#ifndef GFLOW_RELOCATION_H
#define GFLOW_RELOCATION_H
#include "shared/life.h"

// o / S: 1 for n = 1, less for more. `logit` is that of o. Trapezoids of 1/8 up to |u| = 5, where
// the integrand has fallen below n 1e-11: relative error below 1e-6 for n up to 1000.
static inline real shared_scale(real logit, real n) {
  const real opacity = (real)1 / ((real)1 + exp(-logit));
  const real x = (real)1 / ((real)1 + exp(-shared_opacity_logit(logit, n)));
  real sum = (real)0.5f * opacity;  // u = 0, where n together show o
  for (int k = 1; k <= 40; ++k) {
    const real u = (real)k * (real)0.125f;
    sum -= expm1(n * log1p(-x * exp(-u * u)));
  }
  return opacity / (sum * (real)(0.25f * 0.564189584f));  // 2 h / sqrt(pi)
}

#endif
