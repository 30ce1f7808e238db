// SPDX-License-Identifier: Apache-2.0
// Points of a scene that comes without any, from the pictures of several cameras at once: random
// pixels are looked for at many depths, and a pixel becomes a point where the other cameras see the
// same colours (a plane sweep, Collins 1996, at single pixels).
#pragma once
#include "optim/init/motion_mask.hpp"

namespace gflow {

// At most `count` points with the colours of their pixels; none where fewer than two cameras see
// the scene at the same time. Fixed cameras are compared by their usual pictures, so that what
// moves is no matter; others by those of the time step in the middle. Depths are those between
// scene.near and scene.far, else between a quarter and eight times the distance to what the cameras
// look at. Deterministic for a seed.
PointCloud stereo_points(const Scene& scene, FrameStore& frames,
                         const std::vector<StaticCamera>& static_cameras, size_t count,
                         uint32_t seed);

}  // namespace gflow
