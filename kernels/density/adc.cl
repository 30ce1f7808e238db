// SPDX-License-Identifier: Apache-2.0
// Density control "adc": which Gaussians are removed, kept or split in two. Uses sorts and prefix
// sums only: bitwise repeatable. One work-item per Gaussian.
#include "shared/motion/life.h"
#include "shared/view_rows.h"

// After a view: adds up the norms of the loss gradients w.r.t. the splats' positions, in units of
// half the image. With some_ignored a zero gradient counts as not seen: the Gaussian may be in view
// of pixels only that take no part in the loss.
kernel void adc_accumulate(const uint n, const float half_width, const float half_height,
                               const uint some_ignored,
                               global const uint* restrict rows,  // shared/view_rows.h
                               global const uint* restrict tiles_touched,  // [n]
                               global const float* restrict v_means2d,  // [n, 2] [1/px]
                               global float* restrict grad2d,           // [N] sum of norms
                               global float* restrict views) {          // [N] number
  const uint k = get_global_id(0);
  if (k >= n || tiles_touched[k] == 0) return;
  const uint i = view_row(k, rows);
  const float2 v = vload2(k, v_means2d) * (float2)(half_width, half_height);
  const float norm = sqrt(dot(v, v));
  if (!is_finite_real(norm) || (some_ignored && norm == 0.f)) return;
  grad2d[i] += norm;
  views[i] += 1.f;
}

// copies: 0 for Gaussians to remove, 1 for others. keys sorts the candidates for growth, those with
// the largest mean gradient first.
kernel void adc_rank(const uint n, const float threshold, const float min_logit_opacity,
                         const float max_log_scale, const float duration, const float cutoff_sigmas,
                         global const float* restrict logit_opacities,
                         global const float* restrict log_scales,  // [N, 4]
                         global const float* restrict means_t, global const float* restrict grad2d,
                         global const float* restrict views, global uint* restrict copies,
                         global uint* restrict keys, global uint* restrict order) {
  const uint i = get_global_id(0);
  if (i >= n) return;
  const float4 s = vload4(i, log_scales);
  const float mean = views[i] > 0.f ? grad2d[i] / views[i] : 0.f;
  const int stays = logit_opacities[i] >= min_logit_opacity &&
                    fmax(s.x, fmax(s.y, s.z)) <= max_log_scale &&
                    is_visible_in_video(means_t[i], exp(s.w), duration, cutoff_sigmas);
  copies[i] = stays ? 1u : 0u;
  keys[i] = stays && mean > threshold ? ~as_uint(mean) : 0xffffffffu;
  order[i] = i;
}

// The first `allowed` candidates are split in two.
kernel void adc_grow(const uint n, const uint allowed, global const uint* restrict keys,
                         global const uint* restrict order, global uint* restrict copies) {
  const uint k = get_global_id(0);
  if (k < n && k < allowed && keys[k] != 0xffffffffu) copies[order[k]] = 2u;
}

// Row i of the old arrays becomes the copies[i] rows from offsets[i] on: source and child (0:
// unchanged, 1 and 2: the two of a split) of each new row.
kernel void adc_sources(const uint n, global const uint* restrict copies,
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

// Clamps opacities from above: those that the images need rise again, the others become removable.
// Clears the mean gradient of clamped ones, which belongs to another opacity. The mean squared
// gradient is kept: without it the next step would be 1 / sqrt(1 - beta2) times the rate, more than
// the reset itself.
kernel void adc_reset(const uint n, const float most_logit, global float* restrict logit_opacities,
                      global float* restrict exp_avg) {  // null: none is stored
  const uint i = get_global_id(0);
  if (i >= n || !(logit_opacities[i] > most_logit)) return;
  logit_opacities[i] = most_logit;
  if (exp_avg) exp_avg[i] = 0.f;
}

kernel void adc_reorder(const uint n, global const uint* restrict source,
                        global const float* restrict old_grad2d,
                        global const float* restrict old_views, global float* restrict grad2d,
                        global float* restrict views) {
  const uint i = get_global_id(0);
  if (i >= n) return;
  grad2d[i] = old_grad2d[source[i]];
  views[i] = old_views[source[i]];
}
