// SPDX-License-Identifier: Apache-2.0
// Cameras that nobody filmed with: those around a point that a camera looks at.
#pragma once
#include <Eigen/Core>

#include "optim/scene/camera.hpp"

namespace gflow {

// What cameras turn about. up has length 1.
struct Orbit {
  Eigen::Vector3d focus = Eigen::Vector3d::Zero();
  Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
};

// The place of a camera on the orbit: azimuth counter-clockwise from above, elevation above the
// horizon [degrees], distance from the focus. The azimuth counts from an arbitrary direction.
struct OrbitPlace {
  double azimuth = 0, elevation = 0, distance = 0;
};
OrbitPlace place_of(const Orbit& orbit, const Camera& camera);

// The camera moved around the focus, turned along: what it saw of the focus it sees from there. The
// elevation it comes to is cut at 89 degrees.
Camera moved(const Orbit& orbit, Camera camera, double azimuth, double elevation);

// b as seen from a, azimuth in (-180, 180].
OrbitPlace difference(const OrbitPlace& a, const OrbitPlace& b);

// The same view as a square picture: the longer side becomes `size`, the shorter one gets more of
// what is beside it. 0: as it is.
Camera squared(Camera camera, int size);

}  // namespace gflow
