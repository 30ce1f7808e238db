// SPDX-License-Identifier: Apache-2.0
// Novel cameras on an orbit around a point that a camera looks at.
#pragma once
#include <Eigen/Core>

#include "optim/scene/camera.hpp"

namespace gflow {

// Centre and axis of the orbit; up has length 1.
struct Orbit {
  Eigen::Vector3d focus = Eigen::Vector3d::Zero();
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
};

// Position of a camera on the orbit: azimuth counter-clockwise from above, relative to an arbitrary
// direction; elevation above the horizon [degrees]; distance from the focus.
struct OrbitPosition {
  double azimuth = 0, elevation = 0, distance = 0;
};
OrbitPosition place_of(const Orbit& orbit, const Camera& camera);

// Moves a camera around the focus and rotates it along, so that its view of the focus stays centred
// as before. The resulting elevation is clamped to 89 degrees (or the camera's own if that is
// higher).
Camera moved(const Orbit& orbit, Camera camera, double azimuth, double elevation);

// b relative to a; azimuth in [-180, 180].
OrbitPosition difference(const OrbitPosition& a, const OrbitPosition& b);

// The same view as a square image: the longer side becomes `size`, and the shorter side is extended
// beyond the original view. size 0: unchanged.
Camera squared(Camera camera, int size);

}  // namespace gflow
