// SPDX-License-Identifier: Apache-2.0
// Gaussians between a camera and its near plane: the camera looks through this place, so there is
// nothing, but it does not draw them and so cannot remove them. One work-item per Gaussian.
#include "shared/arrays.h"

#define NEAR_CAMERA 18  // rows of the viewmat [3, 4], fx fy cx cy, width, height
// Nearer than this share of the near plane may be the housing and the lens of the camera itself,
// which others see.
#define HOUSING 0.3f

static inline int is_before(float3 p, float near_plane, global const float* camera) {
  const float z = dot(load3(camera + 8, 0), p) + camera[11];
  if (!(z > HOUSING * near_plane && z < near_plane)) return 0;
  const float x = dot(load3(camera, 0), p) + camera[3];
  const float y = dot(load3(camera + 4, 0), p) + camera[7];
  const float u = camera[12] * x / z + camera[14], v = camera[13] * y / z + camera[15];
  return u >= 0.f && u < camera[16] && v >= 0.f && v < camera[17];
}

// Makes such Gaussians so faint that density control removes them.
kernel void near_fade(const uint n, const uint cameras, const float near_plane,
                      const float most_logit,
                      global const float* restrict views,      // [cameras, 18]
                      global const float* restrict means,      // [N, 3] at the time of the views
                      global const float* restrict opacities,  // [N] 0: not visible then
                      global float* restrict logit_opacities) {
  const uint i = get_global_id(0);
  if (i >= n || !(opacities[i] > 0.f)) return;
  const float3 p = load3(means, i);
  for (uint c = 0; c < cameras; ++c)
    if (is_before(p, near_plane, views + NEAR_CAMERA * c)) {
      logit_opacities[i] = fmin(logit_opacities[i], most_logit);
      return;
    }
}
