// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/depths.hpp"

#include <gtest/gtest.h>

namespace gflow {
namespace {

// Two cameras at the origin and at x = 1 that look along z, with an image of 100 x 100.
Scene two_cameras() {
  Scene scene;
  for (const double x : {0., 1.}) {
    Camera camera;
    camera.width = camera.height = 100;
    camera.fx = camera.fy = 100;
    camera.cx = camera.cy = 50;
    camera.viewmat(0, 3) = -x;
    Frame frame;
    frame.camera = int(scene.cameras.size());
    scene.cameras.push_back(camera);
    scene.train.push_back(frame);
  }
  scene.extent = 2;
  return scene;
}

// Adds points straight ahead of the first camera, from a depth on.
void add_points(Scene& scene, int count, double depth) {
  for (int i = 0; i < count; ++i)
    scene.points.xyz.insert(scene.points.xyz.end(), {0, 0, depth + 0.01 * i});
}

TEST(NearPlane, IsAQuarterOfTheNearestDepthOfPointsInView) {
  Scene scene = two_cameras();
  add_points(scene, 500, 8);
  add_points(scene, 500, -8);  // behind
  EXPECT_NEAR(near_plane_of(scene), 2, 1e-9);
  add_points(scene, 3, 0.1);  // fewer than a hundredth
  EXPECT_NEAR(near_plane_of(scene), 2, 1e-9);
  add_points(scene, 30, 0.1);
  EXPECT_NEAR(near_plane_of(scene), 0.03, 0.002);
}

TEST(SizeOfScene, IsTheExtentOrTheDepthOfWhatCamerasSee) {
  Scene scene = two_cameras();
  EXPECT_EQ(size_of_scene(scene), 2);
  add_points(scene, 101, 1);
  EXPECT_EQ(size_of_scene(scene), 2);
  scene.points = {};
  add_points(scene, 101, 20);
  EXPECT_NEAR(size_of_scene(scene), 20.5, 1e-9);
}

TEST(NearPlane, WithoutEnoughPointsFollowsTheSizeOfTheScene) {
  Scene scene = two_cameras();
  EXPECT_NEAR(near_plane_of(scene), 0.02, 1e-9);
  add_points(scene, 10, 8);
  EXPECT_NEAR(near_plane_of(scene), 0.02, 1e-9);
}

TEST(NearPlane, IsHalfOfWhereTheDepthRangeOfTheFilesBegins) {
  Scene scene = two_cameras();
  add_points(scene, 500, 8);
  scene.near = 3;
  EXPECT_NEAR(near_plane_of(scene), 1.5, 1e-9);
}

TEST(NearPlane, TheSettingWinsOverTheScene) {
  Scene scene = two_cameras();
  scene.near_plane = 1;
  EXPECT_EQ(near_or_default(0, scene), 1);
  EXPECT_EQ(near_or_default(0.25f, scene), 0.25f);
}

TEST(NearPlane, PointsBeforeItAreCountedInTheCameraThatHasMostOfThem) {
  Scene scene = two_cameras();
  add_points(scene, 100, 1);   // at 1 to 2: in view of the first camera only
  add_points(scene, 300, 10);  // of both
  EXPECT_NEAR(share_of_points_nearer(scene, 5), 0.25, 1e-9);
  EXPECT_EQ(share_of_points_nearer(scene, 0.5), 0);
}

TEST(PixelSize, IsThatAtTheMedianDepthOfThePoints) {
  Scene scene;
  Camera camera;
  camera.width = camera.height = 100;
  camera.fx = camera.fy = 50;
  camera.cx = camera.cy = 50;
  scene.cameras = {camera};
  scene.train.resize(1);
  for (int i = 0; i < 41; ++i)
    for (const double x : {0., 0., 2. + 0.1 * i}) scene.points.xyz.push_back(x);
  EXPECT_NEAR(pixel_size(scene), 4 / 50., 1e-12);
}

}  // namespace
}  // namespace gflow
