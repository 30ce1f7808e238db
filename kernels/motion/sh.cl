// SPDX-License-Identifier: Apache-2.0
// Colour of each Gaussian from its spherical harmonics, in the direction from the camera to its
// mean at t1. Band 0 has an array of its own, since its learning rate differs. Bands above `degree`
// count as 0; those above `walked` (>= degree) are not read at all. One work-item per Gaussian.
#include "shared/arrays.h"
#include "shared/sh.h"
#include "shared/types.h"
#include "shared/unrolled.h"
#include "shared/view_rows.h"

// Camera centre in the world: -R^T t.
static inline real3 camera_centre(PinholeCamera c) {
  return -make_real3(c.rotation[0] * c.translation[0] + c.rotation[3] * c.translation[1] +
                         c.rotation[6] * c.translation[2],
                     c.rotation[1] * c.translation[0] + c.rotation[4] * c.translation[1] +
                         c.rotation[7] * c.translation[2],
                     c.rotation[2] * c.translation[0] + c.rotation[5] * c.translation[1] +
                         c.rotation[8] * c.translation[2]);
}

static inline real3 sh_sum(ShBasis b, int count, real3 band0, global const float* rest) {
  real3 c = make_real3(0.5f, 0.5f, 0.5f) + band0 * b.y[0];
  FOR_UNROLLED(k, 1, 16, count) c += load3(rest, k - 1) * b.y[k];
  return c;
}

// stride: coefficients stored per Gaussian beside the first.
kernel void sh_fwd(const uint n, const int degree, const int walked, const int stride,
                   const PinholeCamera camera,
                   global const uint* restrict rows,           // shared/view_rows.h
                   global const float* restrict means,         // [n, 3]
                   global const uint* restrict tiles_touched,  // [n] 0: skipped
                   global const float* restrict sh0,           // [N, 3]
                   global const float* restrict sh_rest,       // [N, stride, 3]
                   global float* restrict colors) {            // [n, 3] >= 0
  const uint k = get_global_id(0);
  if (k >= n || tiles_touched[k] == 0) return;
  const uint i = view_row(k, rows);
  const Direction o = direction_to(load3(means, k), camera_centre(camera));
  const int count = (walked + 1) * (walked + 1);
  const real3 c =
      sh_sum(sh_basis(degree, o.d), count, load3(sh0, i), sh_rest + (size_t)i * stride * 3);
  // A non-finite colour stays non-finite, so that transport_fwd leaves that Gaussian out.
  const real3 shown = fmax(c, make_real3(0.f, 0.f, 0.f));
  store3(colors, k, is_finite_real(c.x + c.y + c.z) ? shown : c);
}

// Only for Gaussians visible in this view; other entries are unchanged. Adds to v_means. v_sh0 and,
// if walked > 0, v_sh_rest are set for Gaussians not yet `seen` in this training step and added to
// for the others.
kernel void sh_bwd(const uint n, const int degree, const int walked, const int stride,
                   const PinholeCamera camera, global const uint* restrict rows,
                   global const float* restrict means, global const float* restrict sh0,
                   global const float* restrict sh_rest,
                   global const uint* restrict tiles_touched,
                   global const uint* restrict seen,       // [N]
                   global const float* restrict v_colors,  // [n, 3]
                   global float* restrict v_sh0,           // [N, 3]
                   global float* restrict v_sh_rest,       // [N, stride, 3]
                   global float* restrict v_means) {       // [n, 3]
  const uint entry = get_global_id(0);
  if (entry >= n || tiles_touched[entry] == 0) return;
  const uint i = view_row(entry, rows);
  const Direction o = direction_to(load3(means, entry), camera_centre(camera));
  const ShBasis b = sh_basis(degree, o.d);
  const int count = (walked + 1) * (walked + 1);
  global const float* own = sh_rest + (size_t)i * stride * 3;
  global float* v_own = v_sh_rest + (size_t)i * stride * 3;
  const real3 c = sh_sum(b, count, load3(sh0, i), own);
  real3 v = load3(v_colors, entry);  // no gradient through the clamp at 0
  v = make_real3(c.x > 0.f ? v.x : 0.f, c.y > 0.f ? v.y : 0.f, c.z > 0.f ? v.z : 0.f);
  if (!seen[i]) {
    store3(v_sh0, i, v * b.y[0]);
    const int all = walked == 0 ? 1 : stride + 1;
    FOR_UNROLLED(k, 1, 16, all) store3(v_own, k - 1, v * b.y[k]);  // 0 for inactive bands
  } else {
    add3(v_sh0, i, v * b.y[0]);
    FOR_UNROLLED(k, 1, 16, count) add3(v_own, k - 1, v * b.y[k]);
  }
  if (degree == 0) return;
  ShBasis v_b;
  for (int k = 0; k < 16; ++k) v_b.y[k] = 0.f;
  FOR_UNROLLED(k, 1, 16, count) v_b.y[k] = dot(load3(own, k - 1), v);
  add3(v_means, entry, direction_to_vjp(o, sh_basis_vjp(degree, o.d, v_b)));
}
