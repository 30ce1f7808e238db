// SPDX-License-Identifier: Apache-2.0
// Gaussians given by quaternions and scales: factor L = R(q/|q|) diag(scales), and the gradient.
// One work-item per Gaussian.
#include "shared/arrays.h"
#include "shared/quat.h"

kernel void posed_fwd(const uint n, global const float* restrict quats,  // [N, 4] w x y z
                      global const float* restrict scales,               // [N, 3] linear
                      global float* restrict factors) {                  // [N, 3, 3]
  const uint i = get_global_id(0);
  if (i >= n) return;
  store_mat3(factors, i, factor_of(load4(quats, i), load3(scales, i)));
}

// Gaussians that are not drawn get gradient 0, whatever their values: 0 x NaN would be NaN.
kernel void posed_bwd(const uint n, global const float* restrict quats,
                      global const float* restrict scales,
                      global const float* restrict v_factors,  // [N, 3, 3]
                      global float* restrict v_quats,          // [N, 4]
                      global float* restrict v_scales) {       // [N, 3]
  const uint i = get_global_id(0);
  if (i >= n) return;
  const Mat3 v = load_mat3(v_factors, i);
  FactorGradient g;
  g.quat = make_real4(0.f, 0.f, 0.f, 0.f);
  g.scales = make_real3(0.f, 0.f, 0.f);
  if (any(v.r1 != 0.f) || any(v.r2 != 0.f) || any(v.r3 != 0.f))
    g = factor_of_vjp(load4(quats, i), load3(scales, i), v);
  vstore4(g.quat, i, v_quats);
  store3(v_scales, i, g.scales);
}
