// SPDX-License-Identifier: Apache-2.0
#include "optim/guidance/orbit.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "optim/scene/readers/static_camera.hpp"

namespace gflow {
namespace {

Camera at(double azimuth, double elevation) {
  SceneOptions options;
  options.elevation = elevation;
  return static_camera("c", azimuth, options, 40, 30);
}

// static_camera computes camera positions by an independent formula.
TEST(Orbit, AMovedCameraIsTheOnePlacedThere) {
  for (const auto& [azimuth, elevation] : {std::pair{-75.0, 0.0}, {105.0, 20.0}, {180.0, -30.0}}) {
    const Camera moved_there = moved({}, at(10, 15), azimuth, elevation);
    const Camera placed = at(10 + azimuth, 15 + elevation);
    EXPECT_LT((moved_there.viewmat - placed.viewmat).norm(), 1e-12) << azimuth;
    const OrbitPosition away = difference(place_of({}, at(10, 15)), place_of({}, placed));
    EXPECT_NEAR(std::remainder(away.azimuth - azimuth, 360.0), 0, 1e-9);
    EXPECT_NEAR(away.elevation, elevation, 1e-9);
    EXPECT_NEAR(away.distance, 0, 1e-12);
  }
}

TEST(Orbit, KeepsTheViewOfItsFocusAboutAnyAxis) {
  Orbit orbit;
  orbit.focus = {0.3, -0.2, 0.1};
  orbit.up = Eigen::Vector3d(0.1, -1, 0.2).normalized();
  const Camera camera = at(0, 0);
  for (const double azimuth : {-170.0, 40.0, 90.0}) {
    const Camera other = moved(orbit, camera, azimuth, 25);
    EXPECT_LT((other.project(orbit.focus) - camera.project(orbit.focus)).norm(), 1e-9);
    const OrbitPosition away = difference(place_of(orbit, camera), place_of(orbit, other));
    EXPECT_NEAR(away.azimuth, azimuth, 1e-9);
    EXPECT_NEAR(away.elevation, 25, 1e-9);
  }
}

TEST(Orbit, NeverGoesOverThePole) {
  EXPECT_NEAR(place_of({}, moved({}, at(0, 60), 0, 80)).elevation, 89, 1e-9);
  EXPECT_NEAR(place_of({}, moved({}, at(0, -60), 0, -80)).elevation, -89, 1e-9);
}

TEST(Squared, HoldsTheWholeViewInItsMiddle) {
  const Camera camera = at(0, 0), square = squared(camera, 80);
  EXPECT_EQ(square.width, 80);
  EXPECT_EQ(square.height, 80);
  const Eigen::Vector3d point(0.1, 0.3, -0.2);
  const Eigen::Vector2d a = camera.project(point), b = square.project(point);
  EXPECT_NEAR(b.x(), 2 * a.x(), 1e-9);
  EXPECT_NEAR(b.y(), 2 * a.y() + 10, 1e-9);
  EXPECT_EQ(squared(camera, 0).width, 40);
}

}  // namespace
}  // namespace gflow
