// SPDX-License-Identifier: Apache-2.0
// What the hexplane model's arrays are made for.
#pragma once
#include <array>

namespace gflow {

struct HexplaneShape {
  int resolution = 32;  // cells along x, y and z at the first level, >= 2; doubles at each level
  int times = 16;       // rows in time, at every level; >= 1
  int levels = 2;       // 1 to 4
  int channels = 16;    // a level: 16, 32 or 64
  int hidden = 64;      // neurons of a hidden layer: 32, 64, 128 or 256
  int layers = 2;       // hidden layers, 1 to 4
  std::array<float, 3> centre{0, 0, 0}, half_size{1, 1, 1};  // the box of the planes [world]
  // What is learnt beside the mean; needed in training only.
  bool turn = true, resize = true;
};

// How the planes are kept simple in training; formulas: kernels/hexplane.cl, hexplane_regularize.
struct PlaneRule {
  float plane_tv = 0, time_smoothness = 0, l1_time = 0;
};

}  // namespace gflow
