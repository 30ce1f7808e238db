// SPDX-License-Identifier: Apache-2.0
// Gradient of a loss by a camera (shared/camera_gradient.h), summed over the Gaussians that it
// shows.
#include "shared/arrays.h"
#include "shared/camera_gradient.h"

// Work-item `item` of `items` sums Gaussians item, item + items, and so on, in this order.
kernel void camera_gradient_sums(const uint n, const uint items, const PinholeCamera camera,
                                 global const float* restrict means,      // [n, 3]
                                 global const float* restrict factors,    // [n, 3, 3]
                                 global const uint* restrict shown,       // [n] 0: not read
                                 global const float* restrict v_means,    // [n, 3]
                                 global const float* restrict v_factors,  // [n, 3, 3]
                                 global float* restrict sums) {           // [8, items]
  const uint item = get_global_id(0);
  if (item >= items) return;
  float sum[CAMERA_GRADIENT_SIZE];
  for (int k = 0; k < CAMERA_GRADIENT_SIZE; ++k) sum[k] = 0.f;
  for (uint i = item; i < n; i += items) {
    if (shown[i] == 0) continue;
    const CameraGradient g = camera_gradient(camera, load3(means, i), load_mat3(factors, i),
                                             load3(v_means, i), load_mat3(v_factors, i));
    const float all[CAMERA_GRADIENT_SIZE] = {g.rotation.x,    g.rotation.y,    g.rotation.z,
                                             g.translation.x, g.translation.y, g.translation.z,
                                             g.log_fx,        g.log_fy};
    for (int k = 0; k < CAMERA_GRADIENT_SIZE; ++k) sum[k] += all[k];
  }
  for (int k = 0; k < CAMERA_GRADIENT_SIZE; ++k) sums[k * items + item] = sum[k];
}
