// SPDX-License-Identifier: Apache-2.0
// Density control: which Gaussians go, stay or become two, and the arrays rebuilt accordingly.
// Only sorts and prefix sums: bitwise repeatable. One work-item a Gaussian or a float.
#include "shared/dialect.h"

// After a view: how hard the loss pulls at each splat's place in the image [half the image].
kernel void density_accumulate(const uint n, const float half_width, const float half_height,
                               global const uint* restrict tiles_touched,
                               global const float* restrict v_means2d,  // [N, 2] [1/px]
                               global float* restrict pull,             // [N] sum of norms
                               global uint* restrict views) {           // [N]
  const uint i = get_global_id(0);
  if (i >= n || tiles_touched[i] == 0) return;
  const float2 v = vload2(i, v_means2d) * (float2)(half_width, half_height);
  const float norm = sqrt(dot(v, v));
  if (!is_finite_real(norm)) return;
  pull[i] += norm;
  views[i] += 1;
}

// copies: 0 for what goes, 1 for the rest; keys sort the candidates for growth, hardest pull first.
kernel void density_rank(const uint n, const float threshold, const float min_logit_opacity,
                         const float max_log_scale, const float duration, const float cutoff_sigmas,
                         global const float* restrict logit_opacities,
                         global const float* restrict log_scales,  // [N, 4]
                         global const float* restrict means_t, global const float* restrict pull,
                         global const uint* restrict views, global uint* restrict copies,
                         global uint* restrict keys, global uint* restrict order) {
  const uint i = get_global_id(0);
  if (i >= n) return;
  const float4 s = vload4(i, log_scales);
  const float mean = views[i] ? pull[i] / (float)views[i] : 0.f;
  const float outside = fmax(fmax(-means_t[i], means_t[i] - duration), 0.f);
  const int stays = logit_opacities[i] >= min_logit_opacity &&
                    fmax(s.x, fmax(s.y, s.z)) <= max_log_scale &&
                    outside <= cutoff_sigmas * exp(s.w);
  copies[i] = stays ? 1u : 0u;
  keys[i] = stays && mean > threshold ? ~as_uint(mean) : 0xffffffffu;
  order[i] = i;
}

// The first `allowed` candidates become two.
kernel void density_grow(const uint n, const uint allowed, global const uint* restrict keys,
                         global const uint* restrict order, global uint* restrict copies) {
  const uint k = get_global_id(0);
  if (k < n && k < allowed && keys[k] != 0xffffffffu) copies[order[k]] = 2u;
}

// Row i of the old arrays goes to offsets[i] ...: source and child (0: as it was, 1 and 2: the two
// of a split) of each new row.
kernel void density_sources(const uint n, global const uint* restrict copies,
                            global const uint* restrict offsets, global uint* restrict source,
                            global uint* restrict child) {
  const uint i = get_global_id(0);
  if (i >= n) return;
  const uint count = copies[i], at = offsets[i];
  for (uint c = 0; c < count; ++c) {
    source[at + c] = i;
    child[at + c] = count == 2 ? c + 1 : 0;
  }
}

// New rows from old, in tables of `keys` rows a Gaussian: fresh[k, j, c] = old[k, source[j], c],
// n and old_n Gaussians; 0 for children where `only_old`.
kernel void rows_gather(const uint keys, const uint n, const uint old_n, const uint width,
                        const int only_old, global const uint* restrict source,
                        global const uint* restrict child, global const float* restrict old,
                        global float* restrict fresh) {
  const size_t at = get_global_id(0), row = at / width;
  if (row >= (size_t)keys * n) return;
  const uint j = row % n, k = row / n;
  fresh[at] =
      only_old && child[j] ? 0.f : old[((size_t)k * old_n + source[j]) * width + at % width];
}

kernel void rows_gather_counts(const uint keys, const uint n, const uint old_n,
                               global const uint* restrict source,
                               global const uint* restrict child, global const uint* restrict old,
                               global uint* restrict fresh) {
  const size_t row = get_global_id(0);
  if (row >= (size_t)keys * n) return;
  const uint j = row % n, k = row / n;
  fresh[row] = child[j] ? 0u : old[(size_t)k * old_n + source[j]];
}
