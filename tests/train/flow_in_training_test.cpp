// SPDX-License-Identifier: Apache-2.0
// When the flow loss is active in training, and what the log contains about it.
#include <cmath>

#include "tests/support/on_one_scene.hpp"

namespace gflow {
namespace {

class FlowInTraining : public OnOneScene {};

TEST_F(FlowInTraining, FlowOfWeightZeroChangesNoBit) {
  TrainOptions config = small_config(scene(), 150);
  config.flow.enabled = false;
  const auto without = bits_after(queue(), config, 150);
  config.flow.enabled = true;
  config.flow.weight = 0;
  expect_equal_bits(without, bits_after(queue(), config, 150));
  config.flow.weight = 0.5f;
  config.flow.start = 150;  // later than the last step
  expect_equal_bits(without, bits_after(queue(), config, 150));
}

TEST_F(FlowInTraining, FlowOfPositiveWeightChangesTheModel) {
  TrainOptions config = small_config(scene(), 20);
  const auto with = bits_after(queue(), config, 20);
  config.flow.enabled = false;
  EXPECT_NE(with.at("gaussians/quats"), bits_after(queue(), config, 20).at("gaussians/quats"));
}

TEST_F(FlowInTraining, CalmTilesCountInSomeSteps) {
  TrainOptions config = small_config(scene(), 40);
  config.flow.low_motion = 0.2f;
  config.flow.low_motion_px = 100;  // all tiles are low-motion
  const auto some = bits_after(queue(), config, 40);
  expect_equal_bits(some, bits_after(queue(), config, 40));
  config.flow.low_motion = 1;
  EXPECT_NE(some.at("gaussians/quats"), bits_after(queue(), config, 40).at("gaussians/quats"));
}

// For a model that does not learn, the mean loss over sampled tiles equals that over all tiles.
TEST_F(FlowInTraining, TheLossOfSomeTilesIsThatOfAllInTheMean) {
  constexpr int kSteps = 900;
  constexpr double kShare = 0.3;
  TrainOptions config = small_config(scene(), kSteps);
  config.flow.low_motion_px = 1e6f;  // all tiles are low-motion
  config.flow.every = 1;
  int asked = 0;
  const auto mean_loss = [&](float low_motion) {
    config.flow.low_motion = low_motion;
    SmallTraining training(queue(), config);
    training.trainer.set_rate_scale(0);
    double sum = 0;
    asked = 0;
    for (int i = 0; i < kSteps; ++i) {
      training.steps(queue(), 1);
      const double loss = training.trainer.report(queue()).value("flow_loss");
      if (!(loss > 0)) continue;  // the step has no flow; NaN: no tile was sampled
      sum += loss;
      ++asked;
    }
    return sum / kSteps;
  };
  const double all = mean_loss(1);
  const double with_flow = asked;
  const double some = mean_loss(float(kShare));
  // Deviations: sqrt(.3 .7 / 900) = .015 of the share, sqrt(.7 / .3 / 900) = .051 of the mean;
  // allows four.
  EXPECT_NEAR(asked / with_flow, kShare, 0.07);
  EXPECT_NEAR(some / all, 1, 0.23);
}

TEST_F(FlowInTraining, CountsInEverySecondStepOfStiffPathsAndInEachOfOthers) {
  for (const MotionModelKind kind : {MotionModelKind::spacetime, MotionModelKind::native4d,
                                     MotionModelKind::keyframes, MotionModelKind::hexplane}) {
    TrainOptions config = small_config(scene(), 20);
    config.motion.model = choice_of(kind);
    const auto shipped = bits_after(queue(), config, 20);
    config.flow.every = has_stiff_paths(kind) ? 2 : 1;
    expect_equal_bits(shipped, bits_after(queue(), config, 20));
    config.flow.every = 3 - config.flow.every;
    EXPECT_NE(shipped.at("gaussians/quats"), bits_after(queue(), config, 20).at("gaussians/quats"))
        << int(kind);
  }
}

// A training that does not learn, so that only the logged values differ: with flow every n steps
// and n times the weight, the logged loss is that of the weight.
TEST_F(FlowInTraining, TheLossThatIsToldIsByTheWeight) {
  TrainOptions config = small_config(scene(), 40);
  config.flow.low_motion = 1;
  const auto first_report = [&](int every) {
    config.flow.every = every;
    SmallTraining training(queue(), config);
    training.trainer.set_rate_scale(0);
    StepReport report;
    for (int i = 0; i < 40 && !(report.value("flow_epe") > 0); ++i) {
      training.steps(queue(), 1);
      report = training.trainer.report(queue());
    }
    return report;
  };
  const StepReport each = first_report(1), fifth = first_report(5);
  ASSERT_GT(each.value("flow_loss"), 0);
  EXPECT_EQ(each.value("flow_epe"), fifth.value("flow_epe"));
  EXPECT_NEAR(each.value("flow_loss"), fifth.value("flow_loss"), 1e-6 * each.value("flow_loss"));
}

TEST_F(FlowInTraining, AStepWithoutShowsThatOfTheStepBeforeAlsoWhenResumed) {
  TrainOptions config = small_config(scene(), 60);
  config.flow.low_motion = 1;
  config.flow.every = 4;
  SmallTraining training(queue(), config), other(queue(), config);
  training.steps(queue(), 20);
  for (int done = 20; done < 28; ++done) {  // steps with and without flow
    const Arrays state = training.trainer.state(queue());
    training.steps(queue(), 1);
    const StepReport report = training.trainer.report(queue());
    EXPECT_GT(report.value("flow_epe"), 0);
    other.go_on(queue(), state, done);
    other.steps(queue(), 1);
    const StepReport resumed = other.trainer.report(queue());
    EXPECT_EQ(report.value("flow_epe"), resumed.value("flow_epe"));
    EXPECT_EQ(report.value("flow_loss"), resumed.value("flow_loss"));
    EXPECT_EQ(report.loss, resumed.loss);
  }
}

}  // namespace
}  // namespace gflow
