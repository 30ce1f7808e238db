// SPDX-License-Identifier: Apache-2.0
// Gradient of a loss by the camera that shows a Gaussian, from that by the Gaussian. A camera that
// moves is a world that moves the other way: an image depends on mean and factor in camera
// coordinates, p = W mean + t and F = W L, alone. A focal length multiplies the row of F and p that
// belongs to it, also where the Jacobian is clamped, as the clamp is at a pixel.
// Colours count as given: that their direction of view changes is left out.
#ifndef GFLOW_CAMERA_GRADIENT_H
#define GFLOW_CAMERA_GRADIENT_H
#include "shared/linear.h"
#include "shared/types.h"

#define CAMERA_GRADIENT_SIZE 8

// The camera moves as p' = exp([rotation]) p + translation, and its focal lengths grow by exp() of
// log_focal.
typedef struct CameraGradient {
  real3 rotation;     // [1 / rad], about the axes of the camera
  real3 translation;  // [1 / scene unit], along them
  real log_fx, log_fy;
} CameraGradient;

static inline CameraGradient camera_gradient(PinholeCamera cam, real3 mean, Mat3 factor,
                                             real3 v_mean, Mat3 v_factor) {
  Mat3 w;
  w.r1 = make_real3(cam.rotation[0], cam.rotation[1], cam.rotation[2]);
  w.r2 = make_real3(cam.rotation[3], cam.rotation[4], cam.rotation[5]);
  w.r3 = make_real3(cam.rotation[6], cam.rotation[7], cam.rotation[8]);
  const real3 p =
      make_real3(dot(w.r1, mean) + cam.translation[0], dot(w.r2, mean) + cam.translation[1],
                 dot(w.r3, mean) + cam.translation[2]);
  const real3 v_p = make_real3(dot(w.r1, v_mean), dot(w.r2, v_mean), dot(w.r3, v_mean));
  const Mat3 f = mat3_mul(w, factor), v_f = mat3_mul(w, v_factor);
  CameraGradient g;
  g.translation = v_p;
  g.rotation = make_real3(p.y * v_p.z - p.z * v_p.y + dot(f.r2, v_f.r3) - dot(f.r3, v_f.r2),
                          p.z * v_p.x - p.x * v_p.z + dot(f.r3, v_f.r1) - dot(f.r1, v_f.r3),
                          p.x * v_p.y - p.y * v_p.x + dot(f.r1, v_f.r2) - dot(f.r2, v_f.r1));
  g.log_fx = p.x * v_p.x + dot(f.r1, v_f.r1);
  g.log_fy = p.y * v_p.y + dot(f.r2, v_f.r2);
  return g;
}

#endif
