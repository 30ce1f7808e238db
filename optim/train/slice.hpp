// SPDX-License-Identifier: Apache-2.0
// A moving model at one time, as Gaussians that stand still: what every viewer of static splats can
// show.
#pragma once
#include <array>

#include "optim/io/splat_table.hpp"
#include "optim/train/model.hpp"

namespace gflow {

// Scales s, largest first, and the unit quaternion (w x y z) of R with R diag(s)^2 R^T = L L^T.
// L [3, 3], row by row.
struct FactorParts {
  std::array<double, 3> scales;
  std::array<double, 4> quat;
};
FactorParts parts_of_factor(const float* factor);

// The Gaussians that are there at a scene time in [0, 1], in the model's order; those below the
// temporal cutoff are left out. For any motion model.
SplatTable slice(Queue& queue, Model& model, double scene_time);

}  // namespace gflow
