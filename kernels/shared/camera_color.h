// SPDX-License-Identifier: Apache-2.0
// How a camera shows colours: x + M x + b, with a 3 x 3 matrix M and an offset b of its own, both 0
// for a camera like the others. Kernels compute a lane of pixels at once (shared/loss.h).
#ifndef GFLOW_CAMERA_COLOR_H
#define GFLOW_CAMERA_COLOR_H
#include "shared/loss.h"

#define CAMERA_COLOR_SIZE 12
typedef struct CameraColor {
  real v[CAMERA_COLOR_SIZE];  // per channel a row of M, then its offset
} CameraColor;

typedef struct LaneColor {
  LOSS_LANE c[3];
} LaneColor;

static inline LaneColor camera_color(CameraColor a, LaneColor x) {
  LaneColor y;
  for (int i = 0; i < 3; ++i)
    y.c[i] = x.c[i] + (a.v[4 * i] * x.c[0] + a.v[4 * i + 1] * x.c[1] + a.v[4 * i + 2] * x.c[2] +
                       a.v[4 * i + 3]);
  return y;
}

// d / d x. The derivative w.r.t. M is the outer product of v_y and x, that w.r.t. b is v_y.
static inline LaneColor camera_color_vjp(CameraColor a, LaneColor v_y) {
  LaneColor v_x;
  for (int k = 0; k < 3; ++k)
    v_x.c[k] = v_y.c[k] + (a.v[k] * v_y.c[0] + a.v[4 + k] * v_y.c[1] + a.v[8 + k] * v_y.c[2]);
  return v_x;
}

#endif
