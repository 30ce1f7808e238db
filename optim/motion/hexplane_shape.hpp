// SPDX-License-Identifier: Apache-2.0
// What the hexplane model's arrays are made for.
#pragma once
#include <array>

#include "optim/motion/hexplane_options.hpp"

namespace gflow {

// The options, with `times` decided (>= 1), and the box of the planes.
struct HexplaneShape : HexplaneOptions {
  std::array<float, 3> centre{0, 0, 0}, half_size{1, 1, 1};  // [world]
};

}  // namespace gflow
