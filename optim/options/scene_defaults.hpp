// SPDX-License-Identifier: Apache-2.0
// Settings whose default, 0, leaves their value to the scene.
#pragma once
#include "optim/options/train_options.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// The settings with such values filled in: render.near and density.cap, which is at least the
// number of Gaussians in init.file. Error if that cannot be read.
TrainOptions with_scene_defaults(TrainOptions options, const Scene& scene);

// density.cap of a scene [Gaussians]: 0.4 per pixel of its largest training image at
// scene.resolution, a tenth of that if images have alpha (an object covers few of their pixels),
// and at least 30000.
int default_cap(const Scene& scene, int resolution);

// Whether a training begins with what rests (optim/movers, init.background): the camera of a scene
// without alpha moves, and there is one image at a time.
bool begins_with_background(const Scene& scene, const TrainOptions& options);

}  // namespace gflow
