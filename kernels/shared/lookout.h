// SPDX-License-Identifier: Apache-2.0
// Whether a camera may see Gaussians, LANES at a time, from what is known before their shapes at a
// time are: place, longest axis, opacity (OpenCL C only). What project_fwd (project.cl) draws passes,
// with margins for rounding; so a motion model need not pose what fails (Skips::outside).
#ifndef GFLOW_LOOKOUT_H
#define GFLOW_LOOKOUT_H
#include "shared/lane.h"
#include "shared/types.h"

// e^x to 1e-5 for |x| <= 80, held there beyond.
static inline lane lookout_exp(lane x) {
  return lane_exp2(clamp(x, TO_LANE(-80.f), TO_LANE(80.f)) * 1.44269504f);
}

// A projected covariance is J W L L^T W^T J^T + DILATION I, so neither of its variances, nor its
// largest, exceeds the squares of the two rows of J W together times the longest axis' square. A
// splat as opaque as can be is seen within |z|^2 <= 8 (project.cl: reach). NaN passes.
static inline lane_int may_be_seen(PinholeCamera cam, lane mean_x, lane mean_y, lane mean_z,
                                   lane longest, lane opacity) {
  const lane zero = TO_LANE(0.f);
  const lane px = fma(TO_LANE(cam.rotation[0]), mean_x,
                      fma(TO_LANE(cam.rotation[1]), mean_y,
                          fma(TO_LANE(cam.rotation[2]), mean_z, TO_LANE(cam.translation[0]))));
  const lane py = fma(TO_LANE(cam.rotation[3]), mean_x,
                      fma(TO_LANE(cam.rotation[4]), mean_y,
                          fma(TO_LANE(cam.rotation[5]), mean_z, TO_LANE(cam.translation[1]))));
  const lane pz = fma(TO_LANE(cam.rotation[6]), mean_x,
                      fma(TO_LANE(cam.rotation[7]), mean_y,
                          fma(TO_LANE(cam.rotation[8]), mean_z, TO_LANE(cam.translation[2]))));
  const lane inv_z = 1.f / pz, x = px * inv_z, y = py * inv_z;
  // J is taken at most FOV_MARGIN outside the picture (project)
  const float width = (float)(cam.full_width ? cam.full_width : cam.width);
  const float height = (float)(cam.full_height ? cam.full_height : cam.height);
  const float far_x = (fmax(cam.cx, width - cam.cx) + FOV_MARGIN * 0.5f * width) / cam.fx;
  const float far_y = (fmax(cam.cy, height - cam.cy) + FOV_MARGIN * 0.5f * height) / cam.fy;
  const lane u = fmin(fabs(x), TO_LANE(fabs(far_x))), v = fmin(fabs(y), TO_LANE(fabs(far_y)));
  const lane along =
      cam.fx * cam.fx * fma(u, u, TO_LANE(1.f)) + cam.fy * cam.fy * fma(v, v, TO_LANE(1.f));
  const lane size = longest * inv_z;
  const lane reach = sqrt((8.1f / HALF_LOG2_E) * fma(1.01f * along, size * size, TO_LANE(DILATION)));
  const lane left = fma(TO_LANE(cam.fx), x, TO_LANE(cam.cx - cam.left));
  const lane top = fma(TO_LANE(cam.fy), y, TO_LANE(cam.cy - cam.top));
  const lane_int fails = (opacity < TO_LANE(0.0039f)) |  // 1/255
                         (pz < TO_LANE(cam.near_plane * 0.9999f)) | (left + reach < zero) |
                         (left - reach > TO_LANE((float)cam.width)) | (top + reach < zero) |
                         (top - reach > TO_LANE((float)cam.height));
  return !fails;
}

#endif
