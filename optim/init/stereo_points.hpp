// SPDX-License-Identifier: Apache-2.0
// Initial points for scenes without any, from images of several cameras at one time. Random pixels
// are tested at many depths; a pixel becomes a point where other cameras see the same colours
// (plane sweep, Collins 1996, at single pixels).
#pragma once
#include "optim/init/motion_mask.hpp"

namespace gflow {

// At most `count` points with the colours of their pixels; none if fewer than two cameras see the
// scene at the same time. Static cameras use their median images, so that moving objects do not
// matter; others use the middle time step. Depths range from scene.near to scene.far, else from a
// quarter to eight times the mean distance to the point that the cameras look at. Deterministic for
// a seed.
PointCloud stereo_points(const Scene& scene, FrameStore& frames,
                         const std::vector<StaticCamera>& static_cameras, size_t count,
                         uint32_t seed);

}  // namespace gflow
