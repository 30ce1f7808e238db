// SPDX-License-Identifier: Apache-2.0
// Brings the points of one reconstruction into the world of another, by the cameras both have.
#pragma once
#include <vector>

#include "optim/formats/ply.hpp"
#include "optim/scene/camera.hpp"

namespace gflow {

// Moves points by the similarity x -> s R x + t that takes cameras `from` to `to` (the same
// physical cameras, in the same order): R is the mean of the cameras' rotations, s and t fit the
// positions by least squares. True when the positions then agree within 5 % of their spread; else,
// and with fewer than two places, the points remain as they were.
bool align_points(PointCloud& points, const std::vector<Camera>& from,
                  const std::vector<Camera>& to);

}  // namespace gflow
