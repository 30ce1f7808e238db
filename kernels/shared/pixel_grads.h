// SPDX-License-Identifier: Apache-2.0
// The start of the backward pass: at a pixel, for GPUs, or at the lane vector of pixels at (x, y).
#pragma once
#include "shared/pixel.h"

#if LANES == 1
#define PIXELS_AT size_t at
#define LOAD(plane) plane[at]
#define LOAD_INT(plane) plane[at]
#else
#define PIXELS_AT int x, int y
#define LOAD(plane) lane_load(plane, x, y, width, height)
#define LOAD_INT(plane) lane_load_int(plane, x, y, width, height)
#endif

// The gradient state behind all splats, from what the forward pass stored and the images' gradients.
// That of alpha is applied to 1 - transmittance.
static inline PixelGrads grads_start(
    PIXELS_AT, int width, int height, float3 background, global const float* alpha,
    global const float* flow, global const float* flow_weight, global const float* transmittance, global const int* ends,
    global const float* v_rgb, global const float* v_alpha, global const float* v_depth,
    global const float* v_flow) {
  const size_t pixels = (size_t)width * height;
  PixelGrads p;
  p.T = LOAD(transmittance);
  p.end = LOAD_INT(ends);
  p.vr = LOAD(v_rgb);
  p.vg = LOAD((v_rgb + pixels));
  p.vb = LOAD((v_rgb + 2 * pixels));
  p.R = fma(p.vr, TO_LANE(background.x),
            fma(p.vg, TO_LANE(background.y), p.vb * TO_LANE(background.z)));
  p.R = (p.R - LOAD(v_alpha)) * p.T;
#if DEPTH
  p.vd = LOAD(v_depth);
#endif
#if FLOW
#if TOP_K
  const lane W_flow = LOAD(flow_weight);
  p.flow_end = LOAD_INT((ends + pixels));
#else
  const lane W_flow = LOAD(alpha);
#endif
  const lane zero = TO_LANE(0.f);
  p.vfx = LANE_SELECT(zero, LOAD(v_flow) / W_flow, W_flow > zero);
  p.vfy = LANE_SELECT(zero, LOAD((v_flow + pixels)) / W_flow, W_flow > zero);
  // flow = sum w f / W
  p.v0 = -fma(p.vfx, LOAD(flow), p.vfy * LOAD((flow + pixels)));
#endif
  return p;
}

// Whether a pixel's gradients can be other than 0. With v_alpha alone, R is not 0.
static inline lane_int has_gradient(PixelGrads p) {
  const lane zero = TO_LANE(0.f);
  lane_int any = (p.vr != zero) | (p.vg != zero) | (p.vb != zero) | (p.R != zero);
#if DEPTH
  any |= p.vd != zero;
#endif
#if FLOW
  any |= (p.vfx != zero) | (p.vfy != zero);
#endif
  return any;
}
