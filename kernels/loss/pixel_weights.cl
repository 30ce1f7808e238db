// SPDX-License-Identifier: Apache-2.0
// Pixels that take no part in the image loss, and pixels that matter more than others. Where pixels
// are ignored, their truth becomes what was rendered before the loss, so that windows of SSIM that
// reach into them see no difference.
#include "shared/arrays.h"

kernel void ignored_truth(const uint n, global const uchar* restrict counted,  // [n] 0: ignored
                          global const float* restrict rgb,                    // [3, n]
                          global uchar* restrict truth) {                      // [n, 3]
  const uint i = get_global_id(0);
  if (i >= n || counted[i] != 0) return;
  for (uint c = 0; c < 3; ++c) truth[3 * i + c] = convert_uchar_sat_rte(255.f * rgb[c * n + i]);
}

kernel void weighted_gradient(const uint n, const float black, const float white,
                              global const uchar* restrict mask,  // [n] 0: black
                              global float* restrict v_rgb) {     // [3, n]
  const uint i = get_global_id(0);
  if (i >= n) return;
  const float weight = mask[i] == 0 ? black : white;
  for (uint c = 0; c < 3; ++c)
    v_rgb[c * n + i] = weight == 0.f ? 0.f : weight * v_rgb[c * n + i];
}
