// SPDX-License-Identifier: Apache-2.0
// A training that diverges rolls back and learns more slowly, or ends with a reason.
#include "optim/runs/roll_back.hpp"

#include <cmath>

#include "optim/motion/parameters_state.hpp"
#include "tests/support/command.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

TEST(RollBack, ATrainingIsSoundWhoseLossIsANumberAndThatRefusesFew) {
  StepReport before, now;
  before.gaussians = now.gaussians = 5000;
  before.rejected = 7;
  now.rejected = 7 + 15;
  EXPECT_TRUE(is_finite_report(now, before));
  now.rejected = 7 + 16;
  EXPECT_FALSE(is_finite_report(now, before));
  now.rejected = 7;
  now.non_finite = "gaussians/means";
  EXPECT_FALSE(is_finite_report(now, before));
  now.non_finite.clear();
  for (const double loss : {std::nan(""), HUGE_VAL}) {
    now.loss = loss;
    EXPECT_FALSE(is_finite_report(now, before));
  }
  now.loss = 0;
  EXPECT_TRUE(is_finite_report(now, before));
  now.stuck = 1;
  EXPECT_FALSE(is_finite_report(now, before));
  EXPECT_NE(what_is_non_finite(now, 9).find("1 shared rows of parameters"), std::string::npos);
}

TEST(RollBack, RefusedRowsOfEveryTableCountAndThoseThatAllShareMayNotStayStuck) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  for (const MotionModelKind kind :
       {MotionModelKind::spacetime, MotionModelKind::keyframes, MotionModelKind::bases,
        MotionModelKind::hexplane, MotionModelKind::nodes}) {
    const int motion = int(kind);
    TrainOptions config = small_config(scene, 20);
    config.motion.model = choice_of(kind);
    SmallTraining training(queue, config);
    training.steps(queue, 2);
    EXPECT_EQ(training.trainer.counts(queue).rejected, 0u) << motion;
    Parameters& p = training.model.parameters;
    size_t shared = 0;
    for (Table* table : p.tables()) table->rows.rejected.fill_range(queue, 0, 2, 11);
    for (const TableSpec& spec : p.more_specs) shared += spec.rows > 0 ? 2 : 0;
    EXPECT_EQ(training.trainer.counts(queue).rejected, 2 * p.tables().size()) << motion;
    EXPECT_EQ(training.trainer.counts(queue).stuck, shared) << motion;
    for (Table* table : p.tables()) table->rows.rejected.fill_range(queue, 0, 2, 10);
    EXPECT_EQ(training.trainer.counts(queue).stuck, 0u) << motion;
  }
}

class Broken : public testing::Test {
 protected:
  Broken()
      : queue(test_queue()),
        scene(queue),
        config(small_config(scene, 200)),
        training(queue, config),
        run(RunFolder::create(folder.path() + "/run")),
        checkpoints(queue, config, training.loaded.scene, run, training.trainer,
                    training.model.shape),
        roll_back(queue, run, training.trainer, checkpoints) {}

  // As after an overflow: colours too large for a sum over an image.
  void break_colours() {
    ParameterGroup& sh0 = training.model.parameters["sh0"];
    sh0.values.fill(queue, 3e37f);
  }
  Queue queue;
  SmallScene scene;
  TrainOptions config;
  SmallTraining training;
  TemporaryFolder folder;
  RunFolder run;
  Checkpointer checkpoints;
  RollBack roll_back;
  std::string notice;
};

TEST_F(Broken, GoesBackToTheCheckpointWithHalfTheRates) {
  training.steps(queue, 20);
  checkpoints.write(20, 0);
  auto kept = training.bits(queue);
  break_colours();
  training.steps(queue, 1);
  const StepReport report = training.trainer.report(queue);
  ASSERT_FALSE(is_finite_report(report, {}));
  EXPECT_EQ(roll_back.roll_back(21, report, notice), 20);
  EXPECT_NE(notice.find("rolled back to step 20"), std::string::npos) << notice;
  EXPECT_EQ(training.trainer.rate_scale(), 0.5f);
  auto now = training.bits(queue);
  EXPECT_EQ(now.erase("caution"), 1u);
  EXPECT_EQ(now, kept);

  // Later checkpoints contain the learning-rate scale; the rates are halved.
  const std::vector<float> means = training.model.parameters["means"].values.read(queue);
  const Arrays slow = training.trainer.state(queue);
  const auto step_from = [&](const Arrays& state) {
    training.go_on(queue, state, 20);
    training.steps(queue, 1);
    const std::vector<float> moved = training.model.parameters["means"].values.read(queue);
    double sum = 0;
    for (size_t i = 0; i < means.size(); ++i) sum += std::fabs(double(moved[i] - means[i]));
    return sum;
  };
  Arrays whole = slow;
  whole.erase("caution");
  const double half = step_from(slow);
  EXPECT_EQ(training.trainer.rate_scale(), 0.5f);
  const double full = step_from(whole);
  EXPECT_EQ(training.trainer.rate_scale(), 1.f);
  ASSERT_GT(full, 0);
  EXPECT_NEAR(half / full, 0.5, 1e-3);  // positions are rounded to 1e-7 of their size
  EXPECT_TRUE(is_finite_report(training.trainer.report(queue), {}));
}

TEST_F(Broken, IsNotSavedWhereMemoryEnds) {
  training.steps(queue, 20);
  const StepReport before = training.trainer.report(queue);
  break_colours();
  training.steps(queue, 1);
  roll_back.save_if_finite(21, 0, before);
  EXPECT_TRUE(run.checkpoints().steps().empty());
  // Without a previous report, as right after a resume, rejected gradients date from before.
  roll_back.save_if_finite(21, 0, {});
  EXPECT_EQ(run.checkpoints().steps(), std::vector<int>{21});
}

TEST_F(Broken, WhatIsSoundIsSavedWhereMemoryEnds) {
  training.steps(queue, 20);
  roll_back.save_if_finite(20, 0, training.trainer.report(queue));
  EXPECT_EQ(run.checkpoints().steps(), std::vector<int>{20});
}

TEST_F(Broken, EndsAfterThreeReturnsAndKeepsTheStateItCameTo) {
  checkpoints.write(0, 0);
  StepReport report;
  report.loss = std::nan("");
  for (int k = 0; k < RollBack::most; ++k) EXPECT_EQ(roll_back.roll_back(9, report, notice), 0);
  EXPECT_EQ(training.trainer.rate_scale(), 0.125f);
  expect_error([&] { roll_back.roll_back(9, report, notice); },
               {"the loss is NaN at step 9", "3 rollbacks to step 0", "lr.", "broken.npz"});
  EXPECT_EQ(read_checkpoint(run.path("broken.npz")).facts.step, 9);
  EXPECT_EQ(run.checkpoints().steps(), std::vector<int>{0});
}

// The loss does not show it, because a Gaussian so far away is not rendered.
TEST_F(Broken, ValuesThatAreNoNumbersAreNamedAndNotSaved) {
  training.steps(queue, 20);
  const StepReport before = training.trainer.report(queue);
  training.model.parameters["means"].values.fill_range(queue, 3, 1, HUGE_VALF);
  roll_back.save_if_finite(20, 0, before);
  EXPECT_TRUE(run.checkpoints().steps().empty());
  StepReport report = training.trainer.report(queue);
  report.non_finite = non_finite_array(training.trainer.state(queue));
  expect_error([&] { roll_back.roll_back(20, report, notice); },
               {"gaussians/means contains NaN or Inf at step 20", "broken.npz"});
}

TEST(BrokenRun, EndsWhereParametersAreNoNumbersThoughTheLossIs) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  const TemporaryFolder folder;
  const std::string run = folder.path() + "/run";
  const auto train = [&](const std::string& more) {
    return gflow({"train", scene.path(), "-o", run, "--quiet", "--iterations", "10", "--set",
                  "lr.mean_t=3e38", "--set", more});
  };
  for (const char* more : {"train.log_every=4", "train.save_every=4"}) {
    const Outcome outcome = train(more);
    EXPECT_EQ(outcome.code, 1) << more;
    EXPECT_NE(outcome.err.find("contains NaN or Inf"), std::string::npos) << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_TRUE(RunFolder(run).checkpoints().steps().empty()) << more;
    EXPECT_TRUE(RunFolder(run).models().empty()) << more;
    fs::remove_all(run);
  }
  // Ended by the time limit between two checks of the model.
  const Outcome outcome =
      gflow({"train", scene.path(), "-o", run, "--quiet", "--iterations", "1000000", "--set",
             "lr.scales=3e38", "--set", "train.minutes=0.02", "--set", "train.log_every=1000000",
             "--set", "train.checkpoint_every=0"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_NE(outcome.err.find("its last state is in broken.npz; no step is saved"),
            std::string::npos)
      << outcome.err;
  EXPECT_TRUE(fs::exists(run + "/broken.npz"));
  EXPECT_TRUE(RunFolder(run).models().empty());
}

TEST(BrokenRun, WithoutACheckpointEndsWithASentenceAndGoesOnFromNothing) {
  Queue queue = test_queue();
  const SmallScene scene(queue);
  const TemporaryFolder folder;
  const std::string run = folder.path() + "/run";
  const std::vector<std::string> train{
      "train", scene.path(),         "-o",    run,          "--quiet", "--iterations",     "30",
      "--set", "flow.enabled=false", "--set", "lr.sh=1e37", "--set",   "train.log_every=5"};
  const Outcome outcome = gflow(train);
  EXPECT_EQ(outcome.code, 1);
  EXPECT_NE(outcome.err.find("the loss is"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("no checkpoint"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("lr.*"), std::string::npos) << outcome.err;
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1);
  EXPECT_TRUE(fs::exists(run + "/broken.npz"));
  EXPECT_EQ(
      gflow({"train", scene.path(), "-o", run, "--overwrite", "--quiet", "--iterations", "3"}).code,
      0);
  EXPECT_FALSE(fs::exists(run + "/broken.npz"));
}

}  // namespace
}  // namespace gflow
