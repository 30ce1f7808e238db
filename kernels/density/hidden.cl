// SPDX-License-Identifier: Apache-2.0
// Gaussians that no training view shows, because others are in front of them: nothing has taught
// what they look like from elsewhere. One work-item per Gaussian, or per entry of a view.
#include "shared/view_rows.h"

// The largest share of each Gaussian that a view has shown so far. v_colors: of a backward pass
// with a gradient of 1 to every pixel's colour, that is, the sum of the Gaussian's weights. Alone,
// it would be the sum of alpha (shared/pixel.h), opacity pi / (ln 2 k1 k3). A Gaussian whose centre
// is outside the image shows a part of unknown size there, and counts as shown.
kernel void hidden_see(const uint n, const float width, const float height,
                       global const uint* restrict rows,
                       global const uint* restrict tiles_touched,  // [n]
                       global const float* restrict splats,        // [n, 16]
                       global const float* restrict v_colors,      // [n, 3]
                       global float* restrict shown) {  // [Gaussians]; < 0: not judged
  const uint k = get_global_id(0);
  if (k >= n || tiles_touched[k] == 0) return;
  global const float* s = splats + 16 * (size_t)k;
  const bool inside = s[0] >= 0 && s[0] <= width && s[1] >= 0 && s[1] <= height;
  const float alone = exp2(s[5]) * 4.5323601f / (s[2] * s[4]);  // pi / ln 2
  const uint i = view_row(k, rows);
  shown[i] = fmax(shown[i], inside ? v_colors[3 * k] / alone : 1);
}

kernel void hidden_fade(const uint n, const float least, const float limit,
                        global const float* restrict shown,
                        global float* restrict logit_opacities) {
  const uint i = get_global_id(0);
  if (i < n && shown[i] >= 0 && shown[i] < least) logit_opacities[i] = fmin(logit_opacities[i], limit);
}
