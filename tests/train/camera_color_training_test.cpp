// SPDX-License-Identifier: Apache-2.0
// Training on cameras of different exposure: the scene has the mean colours.
#include "optim/eval/evaluation.hpp"
#include "optim/train/train.hpp"
#include "tests/support/on_one_scene.hpp"
#include "tests/support/scene_in_memory.hpp"

namespace gflow {
namespace {

class CameraColorTraining : public OnOneScene {
 protected:
  // The scene in memory, of which each training camera shows `exposure` times the colours, and the
  // test camera its own.
  Scene with_exposures(const TrainOptions& config, const std::vector<double>& exposures) {
    return in_memory(
        load_scene(config.scene, ""), [&](const Frame& frame, Image& image, bool train) {
          const double exposure = train ? exposures.at(size_t(frame.camera) % exposures.size()) : 1;
          for (uint8_t& level : image.pixels)
            level = uint8_t(std::lround(std::min(255., exposure * level)));
        });
  }

  double psnr_of_test_camera(const std::vector<double>& exposures, CameraColor choice) {
    TrainOptions config = small_config(scene(), 1200);
    config.flow.enabled = false;
    config.density.enabled = false;
    config.loss.camera_color = choice;
    const Scene scene = with_exposures(config, exposures);
    Model model(queue(), train(queue(), scene, config).model);
    const LoadedScene loaded = with_frames(scene, config.scene, folder_.file("frames"));
    return evaluate(queue(), model, config, loaded, loaded.scene.test, {}).mean.psnr;
  }

  TemporaryFolder folder_;
};

// Measured: 23.2 dB off, 25.7 dB on; 25.9 and 25.8 dB if all cameras are alike.
TEST_F(CameraColorTraining, GivesTheSceneItsMeanColours) {
  const std::vector<double> unequal = {0.8, 1, 1.2};
  const double off = psnr_of_test_camera(unequal, CameraColor::off);
  EXPECT_GT(psnr_of_test_camera(unequal, CameraColor::automatic), off + 1.5);
}

TEST_F(CameraColorTraining, LosesNothingWhereCamerasAreAlike) {
  const double off = psnr_of_test_camera({1}, CameraColor::off);
  EXPECT_GT(psnr_of_test_camera({1}, CameraColor::automatic), off - 0.2);
}

TEST_F(CameraColorTraining, GoesOnFromACheckpointThatHasNone) {
  const TrainOptions config = small_config(scene(), 20);
  SmallTraining training(queue(), config);
  training.steps(queue(), 5);
  Arrays state = training.trainer.state(queue());
  size_t removed = 0;
  for (const char* name : {"values", "exp_avg", "exp_avg_sq", "steps"})
    removed += state.erase(std::string("camera_colors/") + name);
  EXPECT_EQ(removed, 4u);
  SmallTraining then(queue(), config);
  EXPECT_NO_THROW(then.go_on(queue(), state, 5));
  then.steps(queue(), 1);
}

}  // namespace
}  // namespace gflow
