// SPDX-License-Identifier: Apache-2.0
// Chooses points that are far apart from each other.
#pragma once
#include <cstddef>
#include <vector>

namespace gflow {

// Squared distance between points i and j of xyz [n, 3].
double squared_distance(const std::vector<float>& xyz, size_t i, size_t j);

// Up to `count` different points among those in [first, end), or [0, end) if that is empty,
// beginning with the first; each next one is the farthest from those before it.
std::vector<size_t> farthest_points(const std::vector<float>& xyz, size_t first, size_t end,
                                    size_t count);

}  // namespace gflow
