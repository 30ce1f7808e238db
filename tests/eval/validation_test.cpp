// SPDX-License-Identifier: Apache-2.0
#include "optim/eval/validation.hpp"

#include "optim/eval/evaluation.hpp"
#include "tests/support/on_one_scene.hpp"

namespace gflow {
namespace {

class ValidationTest : public OnOneScene {
 protected:
  TrainOptions config() {
    TrainOptions config = small_config(scene(), 40);
    config.scene.val_every = 2;  // one of three training cameras
    return config;
  }
};

TEST_F(ValidationTest, IsThePsnrOfTheEvaluation) {
  SmallTraining training(queue(), config());
  ASSERT_EQ(training.loaded.scene.val.size(), size_t(SmallScene::steps));
  training.steps(queue(), 20);
  Validation validation(queue(), training.config, training.loaded);
  ASSERT_TRUE(validation.possible());
  const ValidationPsnr psnr = validation.measure(queue(), training.model);
  const auto evaluated = [&](const std::vector<Frame>& frames) {
    return evaluate(queue(), training.model, training.config, training.loaded, frames, {})
        .mean.psnr_matched;
  };
  EXPECT_NEAR(psnr.val, evaluated(training.loaded.scene.val), 1e-9);
  EXPECT_NEAR(psnr.train, evaluated(sample_of(training.loaded.scene.train, 8)), 1e-9);
}

TEST_F(ValidationTest, ChangesNoBitOfTheTraining) {
  SmallTraining plain(queue(), config()), validated(queue(), config());
  plain.steps(queue(), 40);
  Validation validation(queue(), validated.config, validated.loaded);
  for (int i = 0; i < 4; ++i) {
    validated.steps(queue(), 10);
    validation.measure(queue(), validated.model);
  }
  expect_equal_bits(plain.bits(queue()), validated.bits(queue()));
}

TEST_F(ValidationTest, WarnsOnceWhenItFallsWhileTrainingViewsImprove) {
  const TrainOptions options = config();
  const LoadedScene loaded = load_scene(options.scene, "");
  Validation validation(queue(), options, loaded);
  EXPECT_EQ(validation.warning({25, 26}, 1000), "");
  EXPECT_EQ(validation.warning({27, 28}, 2000), "");
  EXPECT_EQ(validation.warning({26.7, 30}, 3000), "");  // within its noise
  EXPECT_EQ(validation.warning({26, 27}, 4000), "");    // training views are worse, too
  const std::string sentence = validation.warning({26.3, 31}, 5000);
  EXPECT_NE(sentence.find("from 27.0 dB after 2000 steps to 26.3 dB"), std::string::npos)
      << sentence;
  EXPECT_EQ(validation.warning({26.2, 32}, 6000), "");
}

TEST_F(ValidationTest, WarnsOnceWhenTheGapToTrainingViewsOpens) {
  const TrainOptions options = config();
  const LoadedScene loaded = load_scene(options.scene, "");
  Validation validation(queue(), options, loaded);
  EXPECT_EQ(validation.warning({20, 25}, 1000), "");
  EXPECT_EQ(validation.warning({21, 27.5}, 2000), "");  // wide, but from the start
  const std::string sentence = validation.warning({21.2, 29}, 3000);
  EXPECT_NE(sentence.find("reach 21.2 dB after 3000 steps, trained ones 29.0 dB"),
            std::string::npos)
      << sentence;
  EXPECT_EQ(validation.warning({21.3, 32}, 4000), "");
}

}  // namespace
}  // namespace gflow
