// SPDX-License-Identifier: Apache-2.0
// Density control removes Gaussians that are too large for the scene, and the size of a scene is
// not that of the place where its cameras stand.
#include "optim/train/train.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

// 60 steps with one round of density control, on a wall of few points.
size_t gaussians_left(Queue& queue, const SmallScene& small, double extent, float prune_scale) {
  TrainOptions config = small_config(small, 60);
  config.density.grad_threshold = 1e9f;  // no growth
  config.density.prune_scale = prune_scale;
  config.density.start = 20;
  config.density.every = 20;
  Scene scene = read_scene(config.scene.path, config.scene);
  PointCloud few;
  few.source = scene.points.source;
  for (size_t i = 0; i < scene.points.xyz.size(); i += 9)  // every third
    few.xyz.insert(few.xyz.end(), &scene.points.xyz[i], &scene.points.xyz[i] + 3);
  scene.points = few;
  scene.extent = extent;
  return train(queue, scene, config).model.count;
}

TEST(LargeGaussians, AreThoseOfTheSceneNotOfItsCameras) {
  Queue queue = test_queue();
  const SmallScene small(queue);
  const size_t all = gaussians_left(queue, small, 0.1, 100);
  EXPECT_EQ(gaussians_left(queue, small, 0.1, 0.5f), all);
  EXPECT_LT(gaussians_left(queue, small, 0.1, 0.01f), all);
}

}  // namespace
}  // namespace gflow
