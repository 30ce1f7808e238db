// SPDX-License-Identifier: Apache-2.0
// Lens distortion, by the two models that OpenCV, COLMAP and nerfstudio share. With x = X / Z,
// y = Y / Z in camera coordinates and r^2 = x^2 + y^2, a point is stored at
// (fx x' + cx, fy y' + cy), where
//   radial:  d = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6),
//            x' = d x + 2 p1 x y + p2 (r^2 + 2 x^2), y' = d y + p1 (r^2 + 2 y^2) + 2 p2 x y;
//   fisheye: a = atan r, x' = (x / r) a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8), y' likewise.
// Sources: OpenCV's calib3d and COLMAP's camera model documentation.
#pragma once
#include <Eigen/Core>
#include <string>

#include "optim/images/image.hpp"
#include "optim/scene/camera.hpp"

namespace gflow {

// (x', y') of (x, y).
Eigen::Vector2d distorted(const Lens& lens, const Eigen::Vector2d& point);

// The pinhole camera that replaces a camera with a lens; undistorted() makes its images. The
// intrinsics of `camera` are those of the stored image. Size, principal point and focal lengths are
// kept, unless some pixels would have no source: then both focal lengths grow until all have one,
// which crops the rim of the stored image. A radial lens with zero coefficients is no lens. Error
// if a coefficient is not finite or the focal lengths would grow fourfold; `what` names the camera.
Camera pinhole_of_lens(Camera camera, Lens::Kind kind, const std::array<double, 8>& k,
                       const std::string& what);

// Position in the stored image of a position (u, v) in the pinhole image, both in the camera's size
// [px].
Eigen::Vector2d stored_at(const Camera& camera, double u, double v);

// The image as seen by the pinhole camera; unchanged if the camera has no lens. The image must have
// the camera's size.
Image undistorted(const Image& image, const Camera& camera);

}  // namespace gflow
