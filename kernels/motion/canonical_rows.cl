// SPDX-License-Identifier: Apache-2.0
// Density control and learning rates of models that shift canonical Gaussians, one work-item each.
#include "shared/motion/canonical_rows.h"
#include "shared/random.h"

// Makes the two children of a Gaussian (child 1 and 2; rows with 0 are unchanged), which keep its
// path. If it is larger than split_scale, both are drawn from it and 1.6 times smaller; else child
// 2 is drawn from it.
kernel void canonical_split(const uint n, const uint seed, const float split_scale,
                            global const uint* restrict child, global float* restrict means,
                            global const float* restrict quats, global float* restrict log_scales,
                            global float* restrict logit_opacities) {
  const uint i = get_global_id(0);
  if (i >= n || child[i] == 0) return;
  const real4 log_scale = load4(log_scales, i);
  const real3 s = make_real3(exp(log_scale.x), exp(log_scale.y), exp(log_scale.z));
  const int large = fmax(s.x, fmax(s.y, s.z)) > split_scale;
  if (large || child[i] == 2) {
    const Mat3 factor = factor_of(load4(quats, i), s);
    const real2 n1 = random_normal2(seed, 0u, i), n2 = random_normal2(seed, 2u, i);
    const real3 draw = make_real3(n1.x, n1.y, n2.x);
    add3(means, i, make_real3(dot(factor.r1, draw), dot(factor.r2, draw), dot(factor.r3, draw)));
  }
  if (large) {
    const real less = 0.470003629f;  // log 1.6
    vstore4(log_scale - make_real4(less, less, less, 0.f), i, log_scales);
  }
  logit_opacities[i] = half_opacity_logit(logit_opacities[i]);
}

// Learning-rate scale of each Gaussian (lifetime_rate_scale).
kernel void static_rate_scale(const uint n, const float duration, const float power,
                              const float most,
                              global const float* restrict log_scales,  // [N, 4]
                              global float* restrict rate_scale) {      // [N]
  const uint i = get_global_id(0);
  if (i >= n) return;
  rate_scale[i] = lifetime_rate_scale(exp(log_scales[4 * i + 3]), duration, power, most);
}
