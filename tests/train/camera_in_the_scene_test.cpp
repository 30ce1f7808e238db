// SPDX-License-Identifier: Apache-2.0
// A held-out camera in the middle of the scene, between the training cameras and what they film:
// nothing may stand before it that training could not see.
#include "optim/eval/evaluation.hpp"
#include "optim/train/train.hpp"
#include "tests/support/on_one_scene.hpp"
#include "tests/support/scene_in_memory.hpp"

namespace gflow {
namespace {

class CameraInTheScene : public OnOneScene {
 protected:
  // The test camera halfway to the blob.
  static Camera moved(Camera camera) {
    camera.viewmat.setIdentity();
    camera.viewmat.topRightCorner<3, 1>() = Eigen::Vector3d(-0.1, 0, 1.5);
    return camera;
  }

  // The dark housing of the test camera.
  static constexpr uint kParts = 12;
  static Eigen::Vector3f part_of_housing(uint i) {
    return {0.1f + 0.08f * noise(8, i), 0.08f * noise(9, i), -1.5f + 0.08f * noise(10, i)};
  }

  // What a camera sees, with the housing or from inside of it.
  Image seen(const Camera& camera, double time, bool with_housing) {
    HostModel host = scene().truth;
    for (uint i = 0; with_housing && i < kParts; ++i)
      append_gaussian(host, part_of_housing(i), 0.05f, {0.1f, 0.1f, 0.1f}, 0);
    Model model(queue(), host);
    Renderer renderer(queue(), {});
    Shot shot;
    shot.view.camera = shot.view.camera_t2 = pinhole(camera, 0.01f);
    shot.time = time;
    renderer.forward(queue(), model, shot);
    const Images& images = renderer.images();
    return image_of_rgb(images.width, images.height, images.rgb.read(queue()));
  }

  // PSNR of the test camera.
  double psnr(const TrainOptions& config) {
    LoadedScene original = load_scene(config.scene, "");
    Camera& inside = original.scene.cameras[size_t(original.scene.test[0].camera)];
    inside = moved(inside);
    for (uint i = 0; i < kParts; ++i) {
      const Eigen::Vector3f p = part_of_housing(i);
      original.scene.points.xyz.insert(original.scene.points.xyz.end(), {p.x(), p.y(), p.z()});
      original.scene.points.rgb.insert(original.scene.points.rgb.end(), {25, 25, 25});
    }
    const auto change = [&](const Frame& frame, Image& image, bool training) {
      image = seen(original.scene.cameras[size_t(frame.camera)], frame.time, training);
    };
    const Scene scene = in_memory(original, change);
    Model model(queue(), train(queue(), scene, config).model);
    const LoadedScene loaded = with_frames(scene, config.scene, folder_.file("frames"));
    return evaluate(queue(), model, config, loaded, loaded.scene.test, {}).mean.psnr;
  }

  TemporaryFolder folder_;
};

// Measured: 18.4 dB, and 7.1 dB where Gaussians are drawn from 0.01 on.
TEST_F(CameraInTheScene, LooksPastWhatStandsBeforeIt) {
  TrainOptions config = small_config(scene(), 600);
  config.flow.enabled = false;
  const double by_scene = psnr(config);
  EXPECT_GT(by_scene, 17);
  config.render.near = 0.01f;
  EXPECT_LT(psnr(config), by_scene - 8);
}

}  // namespace
}  // namespace gflow
