// SPDX-License-Identifier: Apache-2.0
// What a training step moves is what the settings say: Adam's first step of a row moves each of its
// values by the learning rate, whatever the gradient.
#include <gtest/gtest.h>

#include <cmath>

#include "train/small_scene.hpp"

namespace gflow {
namespace {

constexpr int iterations = 100;

TrainConfig config_of(const SmallScene& scene) {
  TrainConfig config = small_config(scene, iterations);
  config.density.enabled = false;
  config.motion.sh_interval = 10;  // all bands are in use in the steps below
  config.lr.means = 0.1f;  // so large that the rounding of a place is nothing beside it
  config.lr.means_final = 0.001f;
  return config;
}

// The furthest that any value of a group is moved by training step `step` of a new training, which
// must not be the first, that sorts the rows.
double largest_move(Queue& queue, const TrainConfig& config, int step, const std::string& group,
                    double* extent = nullptr) {
  SmallTraining training(queue, config);
  const Buffer<float>& values = training.model.parameters[group].values;
  const std::vector<float> before = values.read(queue);
  training.trainer.step(queue, step);
  const std::vector<float> after = values.read(queue);
  double most = 0;
  for (size_t i = 0; i < after.size(); ++i)
    most = std::max(most, std::fabs(double(after[i]) - before[i]));
  if (extent) *extent = training.loaded.scene.extent;
  return most;
}

TEST(LearningRates, ThatOfPlacesFallsByEqualRatiosTimesTheExtentOfTheScene) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  const TrainConfig config = config_of(scene);
  double extent = 0;
  for (const int step : {25, 50, 99}) {
    const double rate = 0.1 * std::pow(0.01, double(step) / iterations);
    const double move = largest_move(queue, config, step, "means", &extent);
    EXPECT_NEAR(move / extent / rate, 1, 2e-3) << step;  // .001 moves a place at 3 by 1e-4 of it
  }
  EXPECT_GT(std::fabs(extent - 1), 0.05);  // else it would not be seen if it were left out
}

TEST(LearningRates, HigherBandsOfColourLearnSlowerByTheirDivisor) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  TrainConfig config = config_of(scene);
  config.lr.sh = 0.01f;
  config.lr.sh_rest_divisor = 5;
  EXPECT_NEAR(largest_move(queue, config, 50, "sh0"), 0.01, 1e-5);
  EXPECT_NEAR(largest_move(queue, config, 50, "sh_rest"), 0.002, 1e-5);
}

}  // namespace
}  // namespace gflow
