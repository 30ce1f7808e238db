// SPDX-License-Identifier: Apache-2.0
// The flow loss: scale * sum over pixels of confidence * alpha * rho(flow - teacher), rho the
// robust norm of shared/loss.h, alpha a constant: where nothing is drawn, no motion is asked for.
// A pixel without weight (confidence 0, alpha 0, or a teacher that is not a number or moves more
// than 1e5 px) gives exactly 0, whatever the other values are.
// One work-item a pixel; bitwise repeatable, since nothing is summed here.
#include "shared/loss.h"

kernel void flow_loss(const uint pixels, const float scale, const float knee,
                      global const float* restrict flow,        // [2, H, W] px
                      global const float* restrict alpha,       // [H, W]
                      global const float* restrict teacher,     // [2, H, W] px
                      global const uchar* restrict confidence,  // [H, W] 255 = full
                      global float* restrict v_flow,            // [2, H, W]
                      global float* restrict terms) {  // [3, H, W] loss, end point error, counted
  const uint i = get_global_id(0);
  if (i >= pixels) return;
  const real2 target = make_real2(teacher[i], teacher[pixels + i]);
  const real2 difference = make_real2(flow[i] - target.x, flow[pixels + i] - target.y);
  // NaN fails. No &&: a branch here keeps PoCL from vectorising the loop over work-items.
  const int counted = (confidence[i] != 0) & (fabs(target.x) <= TEACHER_LIMIT) &
                      (fabs(target.y) <= TEACHER_LIMIT);
  const float weight = scale * convert_float(confidence[i]) * (1.0f / 255.0f) * alpha[i];
  const int weighted = counted & (weight > 0);
  const real2 v = robust_norm_vjp(difference, knee, weight);
  v_flow[i] = weighted ? v.x : 0.0f;
  v_flow[pixels + i] = weighted ? v.y : 0.0f;
  terms[i] = weighted ? weight * robust_norm(difference, knee) : 0.0f;
  terms[pixels + i] = counted ? robust_norm(difference, 1e-20f) : 0.0f;
  terms[2 * pixels + i] = counted ? 1.0f : 0.0f;
}
