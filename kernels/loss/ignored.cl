// SPDX-License-Identifier: Apache-2.0
// Pixels that take no part in the image loss. Before the loss their truth becomes what was
// rendered, so that windows of SSIM that reach into them see no difference; after it their gradient
// is 0.
#include "shared/arrays.h"

kernel void ignored_truth(const uint n, global const uchar* restrict counted,  // [n] 0: ignored
                          global const float* restrict rgb,                    // [3, n]
                          global uchar* restrict truth) {                      // [n, 3]
  const uint i = get_global_id(0);
  if (i >= n || counted[i] != 0) return;
  for (uint c = 0; c < 3; ++c) truth[3 * i + c] = convert_uchar_sat_rte(255.f * rgb[c * n + i]);
}

kernel void ignored_gradient(const uint n, global const uchar* restrict counted,  // [n] 0: ignored
                             global float* restrict v_rgb) {                      // [3, n]
  const uint i = get_global_id(0);
  if (i >= n || counted[i] != 0) return;
  for (uint c = 0; c < 3; ++c) v_rgb[c * n + i] = 0.f;
}
