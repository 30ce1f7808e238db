// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/move_cameras.hpp"

#include <gtest/gtest.h>

#include "optim/images/image.hpp"
#include "optim/scene/camera_correction.hpp"
#include "optim/scene/loaded_scene.hpp"
#include "optim/scene/similarity.hpp"

namespace gflow {
namespace {

// Four cameras in a row, the last of a test view.
Scene row_of_cameras() {
  Scene scene;
  for (int k = 0; k < 4; ++k) {
    Camera camera;
    camera.width = camera.height = 8;
    camera.fx = camera.fy = 10;
    camera.viewmat.topRightCorner<3, 1>() = Eigen::Vector3d(-k, 0.1 * k * k, 5);
    scene.cameras.push_back(camera);
    Frame frame;
    frame.camera = frame.track = k;
    frame.image = std::make_shared<const Image>(Image{8, 8, 3, std::vector<uint8_t>(192)});
    (k < 3 ? scene.train : scene.test).push_back(frame);
  }
  complete_scene(scene);
  return scene;
}

TEST(MoveCameras, OthersFollowAndImagesStay) {
  const LoadedScene loaded = with_frames(row_of_cameras(), {}, "");
  const Scene& scene = loaded.scene;
  Similarity map;
  map.scale = 1.5;
  map.rotation = Eigen::AngleAxisd(0.3, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  map.shift = {1, -2, 0.5};
  std::map<size_t, Eigen::Matrix4d> poses;
  for (size_t i = 0; i < 3; ++i) poses[i] = map.pose(scene.cameras[i].viewmat);
  move_cameras(scene, poses, 1.1, *loaded.frames);
  for (size_t i = 0; i < 4; ++i) {
    const Camera& moved = loaded.frames->cameras()[i];
    EXPECT_LT((moved.viewmat - map.pose(scene.cameras[i].viewmat)).norm(), 1e-9) << i;
    EXPECT_LT((moved.position() - map(scene.cameras[i].position())).norm(), 1e-9) << i;
    EXPECT_DOUBLE_EQ(moved.fx, 11);
    EXPECT_DOUBLE_EQ(loaded.frames->moved_cameras()[i].fy, 11);
  }
  EXPECT_EQ(loaded.frames->rgb(scene.test[0])->width, 8);
}

TEST(MoveCameras, AFitIsUndone) {
  const LoadedScene loaded = with_frames(row_of_cameras(), {}, "");
  const Scene& scene = loaded.scene;
  std::map<size_t, Eigen::Matrix4d> poses;
  for (size_t i = 0; i < 3; ++i) {
    poses[i] = scene.cameras[i].viewmat;
    poses[i](0, 3) += 0.1 * double(i + 1);
  }
  move_cameras(scene, poses, 1.1, *loaded.frames);
  const std::vector<Camera> before = loaded.frames->cameras();
  Eigen::Matrix4d fitted = before[3].viewmat;
  fitted(1, 3) += 0.2;
  loaded.frames->move_camera(3, fitted, 1.1);
  undo_fits(scene, *loaded.frames);
  for (size_t i = 0; i < 4; ++i) {
    const Camera& camera = loaded.frames->cameras()[i];
    EXPECT_LT((camera.viewmat - before[i].viewmat).norm(), 1e-12) << i;
    EXPECT_DOUBLE_EQ(camera.fx, 11);
  }
}

// A point at the depth of a correction stays where it is while the camera turns about it.
TEST(CameraCorrection, TurnsAboutThePointAtItsDepth) {
  const Camera camera = row_of_cameras().cameras[1];
  CameraCorrection correction;
  correction.turn = {0.1, -0.2, 0.05};
  Camera turned = camera;
  turned.viewmat = correction.applied(camera.viewmat, 5);
  const Eigen::Vector4d pivot = camera.viewmat.inverse() * Eigen::Vector4d(0, 0, 5, 1);
  EXPECT_LT((turned.viewmat * pivot - Eigen::Vector4d(0, 0, 5, 1)).norm(), 1e-12);
  correction.shift = {0.01, 0, 0};
  turned.viewmat = correction.applied(camera.viewmat, 5);
  EXPECT_LT((turned.viewmat * pivot - Eigen::Vector4d(0.05, 0, 5, 1)).norm(), 1e-12);
}

}  // namespace
}  // namespace gflow
