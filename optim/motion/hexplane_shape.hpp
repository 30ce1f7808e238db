// SPDX-License-Identifier: Apache-2.0
// Sizes and box of the hexplane model's field.
#pragma once
#include <array>

#include "optim/motion/hexplane_options.hpp"

namespace gflow {

// The options with `times` resolved (>= 1), and the box that the planes cover.
struct HexplaneShape : HexplaneOptions {
  std::array<float, 3> centre{0, 0, 0}, half_size{1, 1, 1};  // [world]
};

}  // namespace gflow
