// SPDX-License-Identifier: Apache-2.0
#include "optim/options/scene_defaults.hpp"

#include <gtest/gtest.h>

namespace gflow {
namespace {

Scene scene_of(int width, int height) {
  Scene scene;
  Camera camera;
  camera.width = width;
  camera.height = height;
  scene.cameras = {camera};
  scene.train.resize(1);
  scene.near_plane = 0.7;
  return scene;
}

TEST(SceneDefaults, TheCapFollowsThePixels) {
  EXPECT_EQ(default_cap(scene_of(640, 360), 1), 92000);
  EXPECT_EQ(default_cap(scene_of(1352, 1014), 1), 548000);
  EXPECT_EQ(default_cap(scene_of(1352, 1014), 2), 137000);
  EXPECT_EQ(default_cap(scene_of(256, 192), 1), 30000);
  Scene object = scene_of(800, 800);
  object.has_alpha = true;
  EXPECT_EQ(default_cap(object, 1), 30000);
}

TEST(SceneDefaults, FillInWhatIsLeftToTheSceneOnly) {
  const Scene scene = scene_of(640, 360);
  TrainOptions options;
  EXPECT_EQ(with_scene_defaults(options, scene).density.cap, 92000);
  EXPECT_EQ(with_scene_defaults(options, scene).render.near, 0.7f);
  options.density.cap = 10;
  options.render.near = 0.1f;
  EXPECT_EQ(with_scene_defaults(options, scene).density.cap, 10);
  EXPECT_EQ(with_scene_defaults(options, scene).render.near, 0.1f);
}

}  // namespace
}  // namespace gflow
