// SPDX-License-Identifier: Apache-2.0
// The motion model by trial: the best on views that are held back, and a run that goes on with it.
#include "optim/runs/model_trials.hpp"

#include <cmath>
#include <regex>

#include "runtime/files/text_file.hpp"
#include "tests/support/command.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

class ModelTrials : public testing::Test {
 protected:
  ModelTrials() : config_(small_config(scene_, 40)) { config_.motion.trial_steps = 40; }

  // Name of each model tried and the PSNR of its held-back views.
  static std::map<std::string, double> printed(const std::string& output) {
    std::map<std::string, double> trials;
    const std::regex line("trial of (\\w+): PSNR ([0-9.]+) dB");
    for (std::sregex_iterator at(output.begin(), output.end(), line), end; at != end; ++at)
      trials[(*at)[1]] = std::stod((*at)[2]);
    return trials;
  }

  Queue queue_ = test_queue();
  SmallScene scene_{queue_};
  TrainOptions config_;
};

TEST_F(ModelTrials, TheBestOnHeldBackViewsIsChosen) {
  testing::internal::CaptureStderr();
  testing::internal::CaptureStdout();
  const MotionChoice chosen = model_by_trials(queue_, config_, false);
  const auto trials =
      printed(testing::internal::GetCapturedStderr() + testing::internal::GetCapturedStdout());
  ASSERT_EQ(trials.size(), 4u);
  for (const auto& [name, psnr] : trials)
    EXPECT_LE(psnr, trials.at(name_of(chosen)) + 0.31) << name;  // near equals: by the scene
}

TEST(BestOfTrials, IsTheBestButTheSuggestedOneIfItIsNear) {
  using Kind = MotionModelKind;
  const std::map<Kind, double> psnr = {
      {Kind::spacetime, 30}, {Kind::hexplane, 30.2}, {Kind::nodes, 29}};
  EXPECT_EQ(best_of_trials(psnr, Kind::spacetime), Kind::spacetime);
  EXPECT_EQ(best_of_trials(psnr, Kind::hexplane), Kind::hexplane);
  EXPECT_EQ(best_of_trials(psnr, Kind::nodes), Kind::hexplane);
}

TEST_F(ModelTrials, OnlyAnAutomaticModelIsTried) {
  EXPECT_TRUE(chooses_by_trials(config_));
  config_.motion.model = MotionChoice(1);
  EXPECT_FALSE(chooses_by_trials(config_));
  EXPECT_FALSE(chooses_by_trials(TrainOptions{}));
}

// One time step: there is nothing to choose.
TEST_F(ModelTrials, OfWhatNeverMovesNothingIsTried) {
  config_.scene.max_steps = 1;
  testing::internal::CaptureStderr();
  model_by_trials(queue_, config_, false);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

// The choice stands in the settings of the run, and --resume with the same options keeps it.
TEST_F(ModelTrials, ARunGoesOnWithItsModel) {
  const TemporaryFolder folder;
  const std::string run = folder.path() + "/run";
  const std::vector<std::string> command = {"train", scene_.path(),           "-o",
                                            run,     "--iterations",          "30",
                                            "--set", "motion.trial_steps=10", "--resume"};
  const Outcome first = gflow(command);
  ASSERT_EQ(first.code, 0) << first.err;
  EXPECT_EQ(printed(first.out + first.err).size(), 4u);
  const std::string settings = read_text_or_empty(run + "/config.toml");
  EXPECT_EQ(settings.find("model = \"auto\""), std::string::npos);
  const Outcome again = gflow(command);
  EXPECT_EQ(again.code, 0) << again.err;
  EXPECT_EQ(printed(again.out + again.err).size(), 0u);
  EXPECT_EQ(read_text_or_empty(run + "/config.toml"), settings);
}

}  // namespace
}  // namespace gflow
