// SPDX-License-Identifier: Apache-2.0
// Depths that training cameras see: how near there may be something, and how large a pixel is.
#pragma once
#include "optim/scene/scene.hpp"

namespace gflow {

// Scene::near_plane of a scene without a custom of its layout. The first of: half of where the
// depth range of its files begins (Scene::near), a quarter of the depth of the nearest points in
// view of a training camera, a hundredth of Scene::extent.
// Gaussians that are nearer would fill the images of cameras that training does not use.
double near_plane_of(const Scene& scene);

// Share of the points in view of a training camera that are nearer than `near` to it, of the camera
// where it is largest, in [0, 1].
double share_of_points_nearer(const Scene& scene, double near);

// Median depth of the points that a camera sees; 0 if it sees few.
double median_depth_of_points(const Scene& scene, int camera);

// The same, or without enough points the depth of focus_point(), or else Scene::extent; > 0.
double depth_of_scene(const Scene& scene, int camera);

// The median depth of the points in view, over the training images, or Scene::extent if that is
// larger: cameras that stand close together see things that are large compared with their extent.
double size_of_scene(const Scene& scene);

// Size of a pixel of a training image at the depth of what it shows [scene units]: the median over
// cameras, at the median depth of the points in view, without points at focus_point().
// Precondition: there is a training image.
double pixel_size(const Scene& scene);

}  // namespace gflow
