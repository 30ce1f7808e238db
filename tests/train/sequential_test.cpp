// SPDX-License-Identifier: Apache-2.0
// Training one time step after another.
#include "optim/train/sequential.hpp"

#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

TEST(Sequence, WithoutItThereIsOneStageOfAllTimes) {
  ScheduleOptions config;
  config.iterations = 10;
  for (int step = 0; step < 10; ++step) {
    const Stage stage = stage_at(config, 5, step);
    EXPECT_EQ(stage.time_step, -1);
    EXPECT_TRUE(stage.fits() && stage.moves());
    EXPECT_EQ(stage.begins, step == 0);
    EXPECT_DOUBLE_EQ(stage.share, step / 10.0);
  }
}

TEST(Sequence, TheFirstTimeStepGetsItsShareAndTheOthersEqualParts) {
  ScheduleOptions config;
  config.iterations = 100;
  config.sequential = true;
  config.first_share = 0.4f;
  std::vector<int> counts(4, 0), begins(4, 0);
  int last = 0;
  for (int step = 0; step < 100; ++step) {
    const Stage stage = stage_at(config, 4, step);
    ASSERT_GE(stage.time_step, last);
    last = stage.time_step;
    EXPECT_EQ(stage.begins, counts[size_t(last)] == 0);
    EXPECT_NEAR(stage.share, counts[size_t(last)] / (last ? 20.0 : 40.0), 1e-9);
    EXPECT_EQ(stage.fits(), last == 0);
    EXPECT_EQ(stage.moves(), last > 0);
    ++counts[size_t(last)];
    begins[size_t(last)] += stage.begins;
  }
  EXPECT_EQ(counts, (std::vector<int>{40, 20, 20, 20}));
  EXPECT_EQ(begins, (std::vector<int>{1, 1, 1, 1}));
  EXPECT_EQ(stage_at(config, 1, 99).time_step, 0);  // images of one time step
}

class SequenceTest : public testing::Test {
 protected:
  TrainOptions config(int iterations) {
    TrainOptions config = small_config(scene_, iterations);
    config.motion.model = choice_of(MotionModelKind::keyframes);
    config.train.sequential = true;
    config.density.enabled = false;
    return config;
  }
  Queue queue_ = test_queue();
  SmallScene scene_{queue_};
};

TEST_F(SequenceTest, LaterTimeStepsOnlyMoveWhatTheFirstFittedAndStartWithItsVelocity) {
  SmallTraining training(queue_, config(120));
  const int times = training.loaded.scene.steps;
  ASSERT_GE(times, 3);
  const size_t n = training.model.parameters.count;
  int step = 0;
  const auto train_to = [&](int stage) {  // through the first step of a stage
    while (
        !(training.trainer.stage(step).time_step == stage && training.trainer.stage(step).begins))
      ++step, training.steps(queue_, 1);
  };
  train_to(1);
  const HostModel fitted = training.model.read(queue_);
  for (const float x : fitted.groups.at("key_shifts")) ASSERT_EQ(x, 0);
  train_to(2);
  const HostModel moved = training.model.read(queue_);
  for (const char* name : {"means", "quats", "log_scales", "sh0", "logit_opacities", "means_t"})
    EXPECT_EQ(moved.groups.at(name), fitted.groups.at(name)) << name;
  const std::vector<float>& shifts = moved.groups.at("key_shifts");
  const auto block = [&](const std::vector<float>& all, size_t k) {
    return std::vector<float>(all.begin() + long(3 * n * k), all.begin() + long(3 * n * (k + 1)));
  };
  EXPECT_EQ(block(shifts, 0), std::vector<float>(3 * n, 0.f));
  EXPECT_NE(block(shifts, 1), std::vector<float>(3 * n, 0.f));
  training.model.motion->start_key(queue_, training.model.parameters, 2);
  const std::vector<float> started = training.model.read(queue_).groups.at("key_shifts");
  for (size_t i = 0; i < 3 * n; ++i) EXPECT_EQ(started[6 * n + i], 2 * started[3 * n + i]);
}

// A model of the first time step is wrong later where things move; keys that follow the motion are
// not.
TEST_F(SequenceTest, FollowsTheMotion) {
  const auto evaluated = [&](int iterations) {
    SmallTraining training(queue_, config(1500));
    training.steps(queue_, iterations);
    return evaluate(queue_, training.model, training.config, training.loaded,
                    training.loaded.scene.test, {})
        .mean;
  };
  const ViewMetrics first = evaluated(450), all = evaluated(1500);
  EXPECT_GT(all.psnr_dynamic, first.psnr_dynamic + 2);
  EXPECT_LT(all.flow_epe_dynamic, 0.5 * first.flow_epe_dynamic);
}

TEST_F(SequenceTest, EachTimeStepNeedsATrainingImage) {
  TrainOptions asked = config(10);
  Scene scene = load_scene(asked.scene, "").scene;
  const auto require = [&] { require_sequence(asked, scene, model_shape(scene, asked)); };
  EXPECT_NO_THROW(require());
  const auto of_step_2 = [](const Frame& frame) { return frame.step == 2; };
  scene.train.erase(std::remove_if(scene.train.begin(), scene.train.end(), of_step_2),
                    scene.train.end());
  expect_error(require, {"train.sequential", "has none for time step 2"});
  asked.train.sequential = false;
  EXPECT_NO_THROW(require());
}

TEST_F(SequenceTest, OtherModelsAndOtherKeysAreRefused) {
  TrainOptions other = config(10);
  other.motion.model = choice_of(MotionModelKind::spacetime);
  EXPECT_THROW(SmallTraining(queue_, other), Error);
  TrainOptions few = config(10);
  few.motion.keys = 2;
  EXPECT_THROW(SmallTraining(queue_, few), Error);
}

}  // namespace
}  // namespace gflow
