// SPDX-License-Identifier: Apache-2.0
// The depth loss (shared/loss.h) against a depth file, and the scale and shift of files that have
// none of their own. A pixel counts where something is drawn and the file has a value, not NaN.
// Repeatable: every sum is computed by one work-item in one order.
#include "shared/lane_row.h"
#include "shared/loss.h"

#define DEPTH_SUMS 5       // weight w, and the sums of w x, w y, w x x, w x y
#define DEPTH_FIT 4        // of an image: scale, shift, mean of y, whether there is a fit
#define DEPTH_LIMIT 1e30f  // larger values of files are errors

static inline lane_int in_file(lane x) { return fabs(x) <= TO_LANE(DEPTH_LIMIT); }  // NaN fails

// Sums for the least squares fit of y = scale x + shift over the pixels; y is the rendered depth, or
// its inverse if `disparity`. Pixels weigh their alpha, less if the file's value is unusual, and if
// `robust` less where the fit so far is wrong.
// One of `items` work-items takes every items-th vector of pixels.
kernel void depth_fit_sums(const uint n, const uint items, const int disparity, const int robust,
                           const uint image,
                           global const float* restrict fits,    // [images, DEPTH_FIT]
                           global const float* restrict depth,   // [n] sum of w Z
                           global const float* restrict alpha,   // [n]
                           global const float* restrict file,    // [n]
                           global float* restrict partial) {     // [DEPTH_SUMS, items]
  const uint item = get_global_id(0);
  if (item >= items) return;
  global const float* fit = fits + DEPTH_FIT * image;
  const lane zero = TO_LANE(0.f);
  lane sums[DEPTH_SUMS];
  for (int k = 0; k < DEPTH_SUMS; ++k) sums[k] = zero;
  for (uint i = item * LANES; i < n; i += items * LANES) {
    const lane d = row_load(depth + i, n - i), a = row_load(alpha + i, n - i);
    lane x = row_load(file + i, n - i);
    const lane_int counts = (d > zero) & (a > zero) & in_file(x);
    x = LANE_SELECT(zero, x, counts);
    const lane y = LANE_SELECT(zero, disparity ? a / d : d / a, counts);
    lane w = LANE_SELECT(zero, a * depth_file_weight(x), counts);
    if (robust && fit[3] > 0.f) w *= depth_fit_weight((fit[0] * x + fit[1] - y) / fit[2]);
    sums[0] += w;
    sums[1] += w * x;
    sums[2] += w * y;
    sums[3] += w * x * x;
    sums[4] += w * x * y;
  }
  for (int k = 0; k < DEPTH_SUMS; ++k) partial[k * items + item] = ROW_SUM(sums[k]);
}

// The fit; none where fewer than `least` pixels count, all have one depth, or depth decreases where
// the file's increases: then the view says nothing. One work-item.
kernel void depth_fit_solve(const uint items, const float least, const uint image,
                            global const float* restrict partial,  // [DEPTH_SUMS, items]
                            global float* restrict fits) {         // [images, DEPTH_FIT]
  global float* fit = fits + DEPTH_FIT * image;
  float s[DEPTH_SUMS];
  for (int k = 0; k < DEPTH_SUMS; ++k) {
    s[k] = 0.f;
    for (uint i = 0; i < items; ++i) s[k] += partial[k * items + i];
  }
  fit[3] = 0.f;
  if (!(s[0] >= least)) return;
  const float x = s[1] / s[0], y = s[2] / s[0];
  const float variance = s[3] / s[0] - x * x, covariance = s[4] / s[0] - x * y;
  if (!(variance > 1e-6f && covariance > 0.f && y > 0.f)) return;
  fit[0] = covariance / variance;
  fit[1] = y - fit[0] * x;
  fit[2] = y;
  fit[3] = 1.f;
}

// Adds the gradients of scale * sum over the pixels. One work-item per LANES pixels.
kernel void depth_loss(const uint n, const float scale, const float knee, const int disparity,
                       const uint image,
                       global const float* restrict fits,   // [images, DEPTH_FIT]
                       global const float* restrict depth,  // [n] sum of w Z
                       global const float* restrict alpha,  // [n]
                       global const float* restrict file,   // [n]
                       global float* restrict v_depth,      // [n]
                       global float* restrict v_alpha,      // [n]
                       // [3, n] loss; |error|; whether the pixel counts
                       global float* restrict terms) {
  const uint i = get_global_id(0) * LANES;
  if (i >= n) return;
  global const float* fit = fits + DEPTH_FIT * image;
  const int count = n - i;
  const lane zero = TO_LANE(0.f), one = TO_LANE(1.f);
  const lane d = row_load(depth + i, count), a = row_load(alpha + i, count);
  const lane x = row_load(file + i, count), fitted = fit[0] * x + fit[1];
  const lane target = disparity ? 1.f / fitted : fitted;
  const lane_int counts = (d > zero) & (a > zero) & in_file(x) & (fitted > zero) &
                          (TO_LANE(fit[3]) > zero) & (target <= TO_LANE(DEPTH_LIMIT));
  const DepthPixel p =
      depth_pixel(LANE_SELECT(one, d, counts), LANE_SELECT(one, a, counts),
                  LANE_SELECT(one, target, counts), knee);
  row_store(row_load(v_depth + i, count) + LANE_SELECT(zero, scale * p.v_depth, counts),
            v_depth + i, count);
  row_store(row_load(v_alpha + i, count) + LANE_SELECT(zero, scale * p.v_alpha, counts),
            v_alpha + i, count);
  row_store(LANE_SELECT(zero, scale * p.loss, counts), terms + i, count);
  row_store(LANE_SELECT(zero, fabs(p.error), counts), terms + n + i, count);
  row_store(LANE_SELECT(zero, one, counts), terms + 2 * n + i, count);
}
