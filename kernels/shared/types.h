// SPDX-License-Identifier: Apache-2.0
// Structs that go from host to kernel by value: 4-byte scalars only, so that both sides agree.
#ifndef GFLOW_TYPES_H
#define GFLOW_TYPES_H

// A pinhole camera: p = rotation * world + translation (OpenCV axes, +z forward), pixel
// (fx X/Z + cx, fy Y/Z + cy), the centre of pixel (row i, column j) at (j + .5, i + .5).
typedef struct PinholeCamera {
  float rotation[9];     // world to camera, row by row
  float translation[3];
  float fx, fy, cx, cy;  // [px]
  float near_plane;      // a Gaussian whose centre is nearer is not drawn
  int width, height;     // [px] of what is drawn
  // What is drawn may be a part of the picture: then its top left pixel, and the picture's size
  // (0 x 0: it is the whole). Nothing else depends on the part, so neither do the splats.
  float left, top;
  int full_width, full_height;
} PinholeCamera;

#endif
