// SPDX-License-Identifier: Apache-2.0
// The world of a reconstruction is known up to a similarity; this chooses one that is easy to use.
#pragma once
#include "optim/cameras/bundle.hpp"

namespace gflow {

// Moves the world: z up as the cameras were held on average, the median of the points at the
// origin, and the median distance of points from the cameras that see them 4.
void make_upright(const std::vector<FeatureTrack>& tracks, CameraPath& path);

}  // namespace gflow
