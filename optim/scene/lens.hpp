// SPDX-License-Identifier: Apache-2.0
// Lens distortion, by the two models that OpenCV, COLMAP and nerfstudio share. With x = X / Z,
// y = Y / Z in camera coordinates and r^2 = x^2 + y^2, a point is stored at
// (fx x' + cx, fy y' + cy), where
//   radial:  d = (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6),
//            x' = d x + 2 p1 x y + p2 (r^2 + 2 x^2), y' = d y + p1 (r^2 + 2 y^2) + 2 p2 x y;
//   fisheye: a = atan r, x' = x / r a (1 + k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8), y' alike.
// Sources: OpenCV's documentation of calib3d; COLMAP's of its camera models.
#pragma once
#include <Eigen/Core>
#include <string>

#include "optim/images/image.hpp"
#include "optim/scene/camera.hpp"

namespace gflow {

// (x', y') of (x, y).
Eigen::Vector2d distorted(const Lens& lens, const Eigen::Vector2d& point);

// The pinhole camera that stands for one with a lens: undistorted() makes its pictures. Intrinsics
// of `camera` are those of the stored picture. Size, centre and focal lengths stay; only where the
// picture would have pixels without a source, both focal lengths grow until it has none (the rim of
// the stored picture is lost then, nothing is made up). A radial lens of zeros is no lens. Error
// when a coefficient is not finite or the lens bends too much for that; `what` names the camera.
Camera behind_lens(Camera camera, Lens::Kind kind, const std::array<double, 8>& k,
                   const std::string& what);

// The picture as the pinhole camera sees it; as it is where the camera has no lens. The picture
// must have the camera's size.
Image undistorted(const Image& image, const Camera& camera);

}  // namespace gflow
