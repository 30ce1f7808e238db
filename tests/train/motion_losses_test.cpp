// SPDX-License-Identifier: Apache-2.0
// Rigidity, rotation, isometry, velocity and acceleration in the trainer: together with the other
// losses, through density control and a saved state.
#include <cmath>

#include "optim/train/trainer.hpp"
#include "tests/support/compare.hpp"
#include "tests/support/on_one_scene.hpp"

namespace gflow {
namespace {

class MotionLossesInTraining : public OnOneScene {};

// Weights refer to means over all Gaussians, and these are few.
TrainOptions with_motion_losses(TrainOptions config) {
  config.loss.rigidity = 0.01f;
  config.loss.rotation = 1e-4f;
  config.loss.isometry = 0.01f;
  config.loss.velocity = 0.01f;
  config.loss.acceleration = 0.01f;
  config.loss.neighbours_every = 40;
  config.loss.motion_every = 1;
  return config;
}

TEST_F(MotionLossesInTraining, RepeatBitByBitThroughDensityControl) {
  const TrainOptions config = with_motion_losses(small_config(scene(), 250));
  const auto first = bits_after(queue(), config, 250);
  EXPECT_NE(first.at("gaussians/means_t").size(), scene().truth.count);  // density control
  expect_equal_bits(first, bits_after(queue(), config, 250));
}

// Its neighbours are those of step 120.
TEST_F(MotionLossesInTraining, OfAKeptStateGoOnBitByBit) {
  const TrainOptions config = with_motion_losses(small_config(scene(), 200));
  SmallTraining training(queue(), config);
  training.steps(queue(), 130);
  const Arrays state = training.trainer.state(queue());
  training.steps(queue(), 25);
  SmallTraining other(queue(), config);
  other.go_on(queue(), state, 130);
  other.steps(queue(), 25);
  expect_equal_bits(training.bits(queue()), other.bits(queue()));
}

TEST_F(MotionLossesInTraining, OfWeightZeroChangeNoBitAndOthersDo) {
  TrainOptions config = small_config(scene(), 30);
  const auto without = bits_after(queue(), config, 30);
  config.loss.neighbours = 3;  // without an effect
  config.loss.motion_every = 2;
  expect_equal_bits(without, bits_after(queue(), config, 30));
  for (float LossOptions::*weight :
       {&LossOptions::rigidity, &LossOptions::rotation, &LossOptions::isometry,
        &LossOptions::velocity, &LossOptions::acceleration}) {
    TrainOptions with = config;
    with.loss.*weight = 1;
    EXPECT_NE(without.at("gaussians/velocities"),
              bits_after(queue(), with, 30).at("gaussians/velocities"));
  }
}

// With and without flow: without it, the second time is evaluated for these losses alone.
TEST_F(MotionLossesInTraining, TeachEveryMotionModel) {
  for (size_t kind = 0; kind < names_of(MotionModelKind{}).size(); ++kind)
    for (const bool flow : {true, false}) {
      TrainOptions config = with_motion_losses(small_config(scene(), 12));
      config.motion.model = choice_of(MotionModelKind(kind));
      config.flow.enabled = flow;
      SmallTraining training(queue(), config);
      training.steps(queue(), 12);
      const StepReport f = training.trainer.report(queue());
      EXPECT_EQ(f.rejected, 0u);
      EXPECT_GE(f.value("rigidity"), 0);
      EXPECT_TRUE(std::isfinite(f.loss));
      for (const auto& [name, values] : training.model.read(queue()).groups)
        for (const float value : values) ASSERT_TRUE(std::isfinite(value)) << name;
    }
}

// The blob moves as one body; the gradients of each of its Gaussians alone do not show that.
TEST_F(MotionLossesInTraining, OfRigidityMakeNeighboursMoveTogether) {
  TrainOptions config = small_config(scene(), 400);
  config.density.enabled = false;
  config.flow.enabled = false;
  const auto misfit = [&](float weight) {
    config.loss.rigidity = weight;
    config.loss.motion_every = 1;
    SmallTraining training(queue(), config);
    training.steps(queue(), 400);
    return training.trainer.report(queue()).value("rigidity") / double(weight);
  };
  EXPECT_LT(misfit(1), 0.5 * misfit(1e-6f));
}

TEST_F(MotionLossesInTraining, AreInTheReportsOfStepsThatHaveThem) {
  TrainOptions config = small_config(scene(), 10);
  config.loss.velocity = 1;
  config.loss.motion_every = 2;
  SmallTraining training(queue(), config);
  for (const bool has : {true, false, true}) {
    training.steps(queue(), 1);
    const StepReport f = training.trainer.report(queue());
    EXPECT_EQ(std::isfinite(f.value("velocity")), has);
    EXPECT_TRUE(std::isfinite(f.loss));
  }
}

}  // namespace
}  // namespace gflow
