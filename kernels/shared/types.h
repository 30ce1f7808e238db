// SPDX-License-Identifier: Apache-2.0
// Structs passed by value from host to kernels: only 4-byte scalars, so that both layouts agree.
#ifndef GFLOW_TYPES_H
#define GFLOW_TYPES_H

// A pinhole camera: p = rotation * world + translation (OpenCV axes, +z forward), pixel (fx X/Z +
// cx, fy Y/Z + cy). The centre of pixel (row i, column j) is (j + .5, i + .5).
typedef struct PinholeCamera {
  float rotation[9];     // world to camera, row by row
  float translation[3];
  float fx, fy, cx, cy;  // [px]
  float near_plane;      // Gaussians whose centre is nearer are not drawn
  int width, height;     // [px] of the drawn region
  // The drawn region may be a crop of the image: its top left pixel, and the size of the full image
  // (0 x 0: not a crop). A crop moves the splats and changes nothing else about them.
  float left, top;
  int full_width, full_height;
} PinholeCamera;

#endif
