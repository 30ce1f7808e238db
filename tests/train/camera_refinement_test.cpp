// SPDX-License-Identifier: Apache-2.0
// Training with cameras that are not exact (cameras.refine).
#include <Eigen/Geometry>

#include "optim/objectives/camera_objective.hpp"
#include "optim/scene/camera_correction.hpp"
#include "optim/scene/similarity.hpp"
#include "optim/train/train.hpp"
#include "tests/support/on_one_scene.hpp"
#include "tests/support/scene_in_memory.hpp"

namespace gflow {
namespace {

class CameraRefinement : public OnOneScene {
 protected:
  // A degree and one part in a hundred of the distance to the scene, another way for each camera;
  // the test camera, 0, stays.
  static std::vector<Camera> shaken(std::vector<Camera> cameras) {
    for (size_t i = 1; i < cameras.size(); ++i) {
      CameraCorrection shake;
      for (int k = 0; k < 3; ++k) {
        shake.turn[k] = double(noise(20, uint(3 * i) + uint(k)));
        shake.shift[k] = double(noise(21, uint(3 * i) + uint(k)));
      }
      // About the camera itself: the depth of the point it turns about is 0.
      shake.turn *= degree / shake.turn.norm();
      shake.shift *= 0.01 / shake.shift.norm();
      cameras[i].viewmat = shake.applied(cameras[i].viewmat, 0);
      cameras[i].viewmat.topRightCorner<3, 1>() += 3 * shake.shift;
    }
    return cameras;
  }

  TrainOptions config(int iterations, RefineCameras refine) {
    TrainOptions config = small_config(scene(), iterations);
    config.cameras.refine = refine;
    config.flow.enabled = false;
    config.density.enabled = false;
    config.loss.camera_color = CameraColor::off;
    config.lr.cameras = getenv("LRC") ? float(atof(getenv("LRC"))) : 1e-3f;  // few steps
    if (getenv("PULL")) config.cameras.pull = float(atof(getenv("PULL")));
    return config;
  }

  struct Errors {
    double turn = 0, shift = 0;  // mean [degrees], [scene units]
  };
  // Of the training cameras, after the similarity that maps them to the true ones.
  static Errors errors(std::vector<Camera> cameras, std::vector<Camera> truth) {
    cameras.erase(cameras.begin());
    truth.erase(truth.begin());
    const Similarity map = similarity_between(cameras, truth).value();
    Errors errors;
    for (size_t i = 0; i < truth.size(); ++i) {
      Camera mapped = cameras[i];
      mapped.viewmat = map.pose(mapped.viewmat);
      const Eigen::Matrix3d turn =
          mapped.viewmat.topLeftCorner<3, 3>() * truth[i].viewmat.topLeftCorner<3, 3>().transpose();
      errors.turn += Eigen::AngleAxisd(turn).angle() / degree / double(truth.size());
      errors.shift += (mapped.position() - truth[i].position()).norm() / double(truth.size());
    }
    return errors;
  }

  TemporaryFolder folder_;
};

TEST_F(CameraRefinement, FindsTheCamerasOfAKnownScene) {
  TrainOptions on = config(400, RefineCameras::on);
  on.lr.means = on.lr.sh = on.lr.opacity = on.lr.scales = on.lr.quats = on.lr.motion = 0;
  on.cameras.pull = on.cameras.start = 0;
  Scene scene = in_memory(load_scene(on.scene, ""), [](const Frame&, Image&, bool) {});
  const std::vector<Camera> truth = scene.cameras;
  scene.cameras = shaken(truth);
  const Errors before = errors(scene.cameras, truth);
  const LoadedScene loaded = with_frames(scene, on.scene, folder_.file("frames"));
  FlowStore flows(std::vector<FlowStore::Loader>{});
  const std::vector<FlowPair> pairs;
  Model model(queue(), this->scene().truth);
  Trainer trainer({queue(), on, loaded.scene, *loaded.frames, pairs, flows, model},
                  std::vector<Rect>(loaded.scene.train.size()));
  for (int step = 0; step < on.train.iterations; ++step) trainer.step(queue(), step);
  const Errors after = errors(loaded.frames->cameras(), truth);
  // Measured: 0.68 to 0.010 degrees, 0.030 to 0.0007.
  EXPECT_LT(after.turn, 0.05 * before.turn);
  EXPECT_LT(after.shift, 0.05 * before.shift);
}

TEST_F(CameraRefinement, GoesOnWithTheSameBits) {
  TrainOptions options = small_config(scene(), 20);
  options.cameras.refine = RefineCameras::on;
  options.cameras.start = 0;
  SmallTraining whole(queue(), options), first(queue(), options), second(queue(), options);
  whole.steps(queue(), 20);
  first.steps(queue(), 9);
  second.go_on(queue(), first.trainer.state(queue()), 9);
  second.steps(queue(), 11);
  expect_equal_bits(whole.bits(queue()), second.bits(queue()));
  for (size_t i = 0; i < whole.loaded.scene.cameras.size(); ++i)
    EXPECT_EQ(whole.loaded.frames->cameras()[i].viewmat,
              second.loaded.frames->cameras()[i].viewmat);
  EXPECT_NE(whole.loaded.frames->cameras()[1].viewmat, whole.loaded.scene.cameras[1].viewmat);
}

TEST_F(CameraRefinement, IsOffUnlessCamerasWereEstimated) {
  const TrainOptions options = small_config(scene(), 2);
  SmallTraining training(queue(), options);
  training.steps(queue(), 2);
  EXPECT_EQ(training.trainer.state(queue()).count("cameras/start"), 0u);
  Scene estimated = training.loaded.scene;
  EXPECT_FALSE(refines_cameras(options.cameras, estimated));
  estimated.estimated_cameras = true;
  EXPECT_TRUE(refines_cameras(options.cameras, estimated));
}

}  // namespace
}  // namespace gflow
