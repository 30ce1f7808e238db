// SPDX-License-Identifier: Apache-2.0
// Colour of each Gaussian from its spherical harmonics, seen from the camera at its mean at t1.
// `degree` may be below what is stored (bands not yet active cost nothing). One work-item a
// Gaussian.
#include "shared/arrays.h"
#include "shared/sh.h"
#include "shared/types.h"

// Camera centre in the world: -R^T t.
static inline real3 camera_centre(Camera c) {
  return -make_real3(c.rotation[0] * c.translation[0] + c.rotation[3] * c.translation[1] +
                         c.rotation[6] * c.translation[2],
                     c.rotation[1] * c.translation[0] + c.rotation[4] * c.translation[1] +
                         c.rotation[7] * c.translation[2],
                     c.rotation[2] * c.translation[0] + c.rotation[5] * c.translation[1] +
                         c.rotation[8] * c.translation[2]);
}

static inline real3 sh_sum(ShBasis b, int count, global const float* sh) {
  real3 c = make_real3(0.5f, 0.5f, 0.5f);
  for (int k = 0; k < count; ++k) c += load3(sh, k) * b.y[k];
  return c;
}

kernel void sh_fwd(const uint n, const int degree, const int stride, const Camera camera,
                   global const float* restrict means,      // [N, 3]
                   global const float* restrict opacities,  // [N] 0: skipped
                   global const float* restrict sh,         // [N, stride, 3]
                   global float* restrict colors) {         // [N, 3] >= 0
  const uint i = get_global_id(0);
  if (i >= n || !(opacities[i] > 0.f)) return;
  const Direction o = direction_to(load3(means, i), camera_centre(camera));
  const int count = (degree + 1) * (degree + 1);
  const real3 c = sh_sum(sh_basis(degree, o.d), count, sh + (size_t)i * stride * 3);
  store3(colors, i, fmax(c, make_real3(0.f, 0.f, 0.f)));
}

// Adds to v_sh and v_means for what was seen; leaves the rest alone.
kernel void sh_bwd(const uint n, const int degree, const int stride, const Camera camera,
                   global const float* restrict means, global const float* restrict sh,
                   global const uint* restrict tiles_touched,
                   global const float* restrict v_colors,  // [N, 3]
                   global float* restrict v_sh,            // [N, stride, 3]
                   global float* restrict v_means) {       // [N, 3]
  const uint i = get_global_id(0);
  if (i >= n || tiles_touched[i] == 0) return;
  const Direction o = direction_to(load3(means, i), camera_centre(camera));
  const ShBasis b = sh_basis(degree, o.d);
  const int count = (degree + 1) * (degree + 1);
  global const float* own = sh + (size_t)i * stride * 3;
  global float* v_own = v_sh + (size_t)i * stride * 3;
  const real3 c = sh_sum(b, count, own);
  real3 v = load3(v_colors, i);  // no gradient through the clamp at 0
  v = make_real3(c.x > 0.f ? v.x : 0.f, c.y > 0.f ? v.y : 0.f, c.z > 0.f ? v.z : 0.f);
  ShBasis v_b;
  for (int k = 0; k < 16; ++k) v_b.y[k] = 0.f;
  for (int k = 0; k < count; ++k) {
    v_b.y[k] = dot(load3(own, k), v);
    add3(v_own, k, v * b.y[k]);
  }
  if (degree > 0) add3(v_means, i, direction_to_vjp(o, sh_basis_vjp(degree, o.d, v_b)));
}
