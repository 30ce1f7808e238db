// SPDX-License-Identifier: Apache-2.0
// Initial points from metric depth files: random pixels at their depths.
#pragma once
#include "optim/formats/ply.hpp"
#include "optim/scene/frame_store.hpp"

namespace gflow {

// Whether a training image has a depth file in scene units.
bool has_metric_depth(const Scene& scene, const SceneOptions& options);

// `count` points with the colours of their pixels, from the training images that have depth at the
// time step where most have; fewer if many of their pixels have no depth or do not count, none
// without metric files. Deterministic for a seed.
PointCloud depth_points(const Scene& scene, FrameStore& frames, const SceneOptions& options,
                        size_t count, uint32_t seed);

}  // namespace gflow
