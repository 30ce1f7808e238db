// SPDX-License-Identifier: Apache-2.0
// Training with depth files: from two cameras that cannot tell depth by themselves, and that a
// checkpoint continues with the same bits.
#include <filesystem>
#include <random>

#include "optim/eval/evaluation.hpp"
#include "optim/train/preparation.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

class DepthTraining : public testing::Test {
 protected:
  // Writes the depth of the true model, changed by f, for camera c.
  template <class F>
  void write_depth(int c, F&& f) {
    Model model(queue_, scene_.truth);
    Renderer renderer(queue_, {});
    for (int k = 0; k < SmallScene::steps; ++k) {
      Shot shot;
      const Camera camera = small_camera(c, 48, 40);
      shot.view.camera = shot.view.camera_t2 = pinhole(camera, 0.05f);
      shot.time = double(k) / (SmallScene::steps - 1);
      shot.depth = true;
      renderer.forward(queue_, model, shot);
      std::vector<float> depth = renderer.images().depth.read(queue_);
      const std::vector<float> alpha = renderer.images().alpha.read(queue_);
      for (size_t i = 0; i < depth.size(); ++i)
        depth[i] = alpha[i] > 0.5f ? f(depth[i] / alpha[i]) : 0;
      const std::string name = fmt::format("depth/cam{:02}/{:04}.npy", c, k);
      std::filesystem::create_directories(
          std::filesystem::path(scene_.folder().file(name)).parent_path());
      write_npy(scene_.folder().file(name), {{40, 48}, depth});
    }
  }

  // Two training cameras and points at wrong depths.
  TrainOptions two_cameras(int iterations) {
    TrainOptions config = small_config(scene_, iterations);
    config.scene.skip_cameras = "cam03";
    config.flow.enabled = false;
    config.init.from = InitFrom::random;
    config.init.count = 600;
    config.density.cap = 600;
    return config;
  }

  // Mean relative error of the depth that the test camera sees.
  double depth_error(const TrainOptions& config) {
    SmallTraining training(queue_, config);
    training.steps(queue_, config.train.iterations);
    TrainOptions evaluated = config;
    evaluated.scene.depth = DepthFiles::metric;
    const LoadedScene loaded = load_scene(evaluated.scene, "");
    return evaluate(queue_, training.model, evaluated, loaded, loaded.scene.test, {})
        .mean.depth_error;
  }

  Queue queue_ = test_queue();
  SmallScene scene_{queue_};
};

TEST_F(DepthTraining, FindsTheDepthThatTwoCamerasLeaveOpen) {
  write_depth(0, [](float z) { return z; });  // of the test camera, for evaluation
  TrainOptions config = two_cameras(600);
  const double without = depth_error(config);
  for (const int c : {1, 2}) write_depth(c, [](float z) { return z; });
  config.loss.depth = 1;
  EXPECT_LT(depth_error(config), 0.6 * without);
}

// As networks for single images estimate it, with some outliers. A fit needs a scene that is
// roughly right.
TEST_F(DepthTraining, LearnsFromDisparityUpToScaleAndShift) {
  write_depth(0, [](float z) { return z; });
  TrainOptions config = two_cameras(600);
  config.init.from = InitFrom::points;
  config.density.enabled = false;
  const double without = depth_error(config);
  std::mt19937 rng(1);
  for (const int c : {1, 2})
    write_depth(c, [&](float z) { return rng() % 50 == 0 ? 3.f : 1.f + 0.7f / z; });
  config.scene.depth = DepthFiles::disparity;
  config.loss.depth = 1;
  EXPECT_LT(depth_error(config), 0.8 * without);
}

TEST_F(DepthTraining, GoesOnWithTheSameBits) {
  for (const int c : {1, 2}) write_depth(c, [](float z) { return z; });
  TrainOptions config = two_cameras(40);
  config.loss.depth = 0.3f;
  SmallTraining whole(queue_, config), first(queue_, config), second(queue_, config);
  whole.steps(queue_, 20);
  first.steps(queue_, 9);
  second.go_on(queue_, first.trainer.state(queue_), 9);
  second.steps(queue_, 11);
  EXPECT_TRUE(whole.bits(queue_) == second.bits(queue_));
}

TEST_F(DepthTraining, NeedsFiles) {
  TrainOptions config = two_cameras(10);
  config.loss.depth = 0.3f;
  expect_error([&] { Preparation(config, ""); }, {"loss.depth", "depth/", "depth_file_path"});
  config.loss.depth = 0;
  config.init.from = InitFrom::depth;
  Preparation prepared(config, "");
  expect_error([&] { prepared.first_model(queue_); }, {"depth file", "init.from"});
}

TEST_F(DepthTraining, WarnsOfFilesThatSayNothingOrHaveAnotherUnit) {
  TrainOptions config = two_cameras(10);
  config.loss.depth = 0.3f;
  const auto warned = [&] {
    testing::internal::CaptureStderr();
    Preparation(config, "");
    return testing::internal::GetCapturedStderr();
  };
  for (const int c : {1, 2}) write_depth(c, [](float z) { return z; });
  EXPECT_EQ(warned().find("depth"), std::string::npos);
  for (const int c : {1, 2}) write_depth(c, [](float z) { return 1000 * z; });
  EXPECT_NE(warned().find("scene.depth_unit"), std::string::npos);
  config.scene.depth = DepthFiles::scaled;
  EXPECT_EQ(warned().find("depth files"), std::string::npos);
  write_depth(1, [](float) { return 0.f; });
  EXPECT_NE(warned().find("5 of 10 depth files have no depth"), std::string::npos);
}

TEST_F(DepthTraining, WarnsOfFilesThatCannotBeFitted) {
  TrainOptions config = two_cameras(10);
  config.init.from = InitFrom::points;
  config.density.enabled = false;
  config.loss.depth = 0.3f;
  const auto warned = [&](DepthFiles files) {
    config.scene.depth = files;
    SmallTraining training(queue_, config);
    testing::internal::CaptureStderr();
    for (int i = 0; i < 10; ++i) {
      training.steps(queue_, 1);
      training.trainer.report(queue_);
    }
    return testing::internal::GetCapturedStderr();
  };
  for (const int c : {1, 2}) write_depth(c, [](float z) { return z; });
  EXPECT_EQ(warned(DepthFiles::scaled), "");
  const std::string warning = warned(DepthFiles::disparity);
  EXPECT_NE(warning.find("train nothing"), std::string::npos) << warning;
  EXPECT_NE(warning.find("is it scaled?"), std::string::npos) << warning;
}

// More than half of the pixels at one value; in any unit.
TEST_F(DepthTraining, FitsDisparityThatIsMostlyClipped) {
  TrainOptions config = two_cameras(120);
  config.init.from = InitFrom::points;
  config.density.enabled = false;
  config.scene.depth = DepthFiles::disparity;
  config.loss.depth = 0.3f;
  const auto error_of = [&](float unit) {
    for (const int c : {1, 2})
      write_depth(c, [&](float z) { return unit * std::max(0.f, 1 / z - 0.26f); });
    SmallTraining training(queue_, config);
    training.steps(queue_, 120);
    return training.trainer.state(queue_).at("depth_loss/last").as_float()[1];
  };
  const float error = error_of(1);
  EXPECT_LT(error, 0.2f);
  EXPECT_NEAR(error_of(60000), error, 0.01f);
}

// Every first Gaussian is at the depth of its pixel in one of the two cameras.
TEST_F(DepthTraining, BeginsAtTheDepthsOfItsFiles) {
  for (const int c : {1, 2}) write_depth(c, [](float) { return 2.5f; });
  TrainOptions config = two_cameras(10);
  config.loss.depth = 0.3f;
  config.init.count = 150;
  std::filesystem::remove(scene_.folder().file("points3D.ply"));
  for (const InitFrom from : {InitFrom::depth, InitFrom::automatic}) {
    config.init.from = from;
    Preparation prepared(config, "");
    prepared.find_motion_masks();
    const HostModel model = prepared.first_model(queue_);
    ASSERT_EQ(model.count, 150u);
    const std::vector<float>& means = model.groups.at("means");
    for (size_t i = 0; i < 150; ++i) {
      const Eigen::Vector4d p(double(means[3 * i]), double(means[3 * i + 1]),
                              double(means[3 * i + 2]), 1);
      double nearest = 1;
      for (const int c : {1, 2})
        nearest = std::min(nearest, std::fabs((small_camera(c, 48, 40).viewmat * p).z() - 2.5));
      EXPECT_LT(nearest, 1e-5);
    }
  }
}

}  // namespace
}  // namespace gflow
