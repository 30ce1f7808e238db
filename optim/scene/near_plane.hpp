// SPDX-License-Identifier: Apache-2.0
// How near to a camera a scene may have something to see. Gaussians that are nearer fill the images
// of cameras that training does not use.
#pragma once
#include "optim/scene/scene.hpp"

namespace gflow {

// Scene::near_plane of a scene without a custom of its layout. The first of: half of where the
// depth range of its files begins (Scene::near), a quarter of the depth of the nearest points in
// view of a training camera, a hundredth of Scene::extent.
double near_plane_of(const Scene& scene);

// Share of the points in view of a training camera that are nearer than `near` to it, of the camera
// where it is largest, in [0, 1].
double share_of_points_nearer(const Scene& scene, double near);

}  // namespace gflow
