// SPDX-License-Identifier: Apache-2.0
// Colours of cameras (shared/camera_color.h): a view as its camera shows it, and the gradients.
// Repeatable: every sum is computed by one work-item in one order.
#include "shared/camera_color.h"
#include "shared/lane_row.h"

static inline CameraColor load_color(global const float* colors, uint camera) {
  CameraColor a;
  for (uint k = 0; k < CAMERA_COLOR_SIZE; ++k) a.v[k] = colors[CAMERA_COLOR_SIZE * camera + k];
  return a;
}

static inline LaneColor load_pixels(global const float* planes, uint n, uint i) {
  LaneColor x;
  for (uint c = 0; c < 3; ++c) x.c[c] = row_load(planes + c * n + i, n - i);
  return x;
}

static inline void store_pixels(LaneColor x, global float* planes, uint n, uint i) {
  for (uint c = 0; c < 3; ++c) row_store(x.c[c], planes + c * n + i, n - i);
}

// One work-item per LANES pixels.
kernel void camera_color_fwd(const uint n, const uint camera,
                             global const float* restrict colors,  // [cameras, 12]
                             global const float* restrict rgb,     // [3, n]
                             global float* restrict shown) {       // [3, n]
  const uint i = get_global_id(0) * LANES;
  if (i < n)
    store_pixels(camera_color(load_color(colors, camera), load_pixels(rgb, n, i)), shown, n, i);
}

// Turns dL / d shown into dL / d rgb. One of `items` work-items takes every items-th vector of
// pixels.
kernel void camera_color_bwd(const uint n, const uint items, const uint camera,
                             global const float* restrict colors,  // [cameras, 12]
                             global const float* restrict rgb,     // [3, n]
                             global float* restrict v_rgb,         // [3, n]
                             global float* restrict partial) {     // [12, items] dL / d colors
  const uint item = get_global_id(0);
  if (item >= items) return;
  const CameraColor a = load_color(colors, camera);
  lane sums[CAMERA_COLOR_SIZE];
  for (int k = 0; k < CAMERA_COLOR_SIZE; ++k) sums[k] = TO_LANE(0.f);
  for (uint i = item * LANES; i < n; i += items * LANES) {
    const LaneColor x = load_pixels(rgb, n, i), v = load_pixels(v_rgb, n, i);
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) sums[4 * r + c] += v.c[r] * x.c[c];
      sums[4 * r + 3] += v.c[r];
    }
    store_pixels(camera_color_vjp(a, v), v_rgb, n, i);
  }
  for (int k = 0; k < CAMERA_COLOR_SIZE; ++k) partial[k * items + item] = ROW_SUM(sums[k]);
}

// The gradient of loss and shrinkage, shrink / 2 times the sum of squares. One work-item per number
// of the camera.
kernel void camera_color_grads(const uint items, const uint camera, const float shrink,
                               global const float* restrict partial,  // [12, items]
                               global const float* restrict colors,   // [cameras, 12]
                               global float* restrict grads) {        // [cameras, 12]
  const uint k = get_global_id(0);
  if (k >= CAMERA_COLOR_SIZE) return;
  float sum = 0;
  for (uint i = 0; i < items; ++i) sum += partial[k * items + i];
  grads[CAMERA_COLOR_SIZE * camera + k] = sum + shrink * colors[CAMERA_COLOR_SIZE * camera + k];
}

// Makes the mean over the cameras 0: otherwise all of them and the scene could change together.
kernel void camera_color_center(const uint cameras, global float* restrict colors) {
  const uint k = get_global_id(0);
  if (k >= CAMERA_COLOR_SIZE) return;
  float sum = 0;
  for (uint i = 0; i < cameras; ++i) sum += colors[CAMERA_COLOR_SIZE * i + k];
  const float mean = sum / (float)cameras;
  for (uint i = 0; i < cameras; ++i) colors[CAMERA_COLOR_SIZE * i + k] -= mean;
}
