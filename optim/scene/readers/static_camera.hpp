// SPDX-License-Identifier: Apache-2.0
// The camera of footage without cameras: static, looking at the origin, z up.
#pragma once
#include <string>

#include "optim/scene/camera.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// A camera at r (cos el cos az, cos el sin az, sin el) with options.radius, elevation and fov_y;
// azimuth in degrees, size in pixels. Error if an option is out of range.
Camera static_camera(const std::string& name, double azimuth, const SceneOptions& options,
                     int width, int height);

}  // namespace gflow
