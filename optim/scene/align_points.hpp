// SPDX-License-Identifier: Apache-2.0
// Moves the points of one reconstruction into the world of another, using the cameras of both.
#pragma once
#include <vector>

#include "optim/formats/ply.hpp"
#include "optim/scene/camera.hpp"

namespace gflow {

// Applies the similarity x -> s R x + t that maps cameras `from` to `to` (the same physical cameras
// in the same order). R is the mean relative rotation; s and t are a least-squares fit of the
// positions. Returns true if the positions then agree within 5 % of their spread. Otherwise, or
// with fewer than two distinct positions, returns false and leaves the points unchanged.
bool align_points(PointCloud& points, const std::vector<Camera>& from,
                  const std::vector<Camera>& to);

}  // namespace gflow
