// SPDX-License-Identifier: Apache-2.0
// The pose of a view is found from its image, for the model that drew it.
#include "optim/eval/camera_fit.hpp"

#include "optim/scene/camera_correction.hpp"
#include "tests/support/on_one_scene.hpp"

namespace gflow {
namespace {

class CameraFit : public OnOneScene {
 protected:
  static constexpr double depth = 3;

  struct Fitted {
    double turn, place;  // errors left [degrees], [scene units]
  };
  // Starts off the true camera; an image, of which `changed` pixels are black, is of the truth.
  Fitted fit(const CameraCorrection& off, const Image* counted) {
    Model model(queue(), scene().truth);
    Renderer renderer(queue(), {});
    const Camera truth = small_camera(0, 96, 80);
    Shot shot;
    shot.view.camera = shot.view.camera_t2 = pinhole(truth, 0.05f);
    shot.time = shot.time_t2 = 0.5;
    renderer.forward(queue(), model, shot);
    Image image = image_of_rgb(truth.width, truth.height, renderer.images().rgb.read(queue()));
    for (size_t i = 0; counted && i < counted->pixels.size(); ++i)
      for (size_t c = 0; c < 3 && !counted->pixels[i]; ++c) image.pixels[3 * i + c] = 0;
    Camera start = truth;
    start.viewmat = off.applied(truth.viewmat, depth);
    Camera found = start;
    found.viewmat = fitted_pose(queue(), model, renderer, shot, start, depth, image, counted);
    const Eigen::Matrix3d turn =
        found.viewmat.topLeftCorner<3, 3>() * truth.viewmat.topLeftCorner<3, 3>().transpose();
    return {Eigen::AngleAxisd(turn).angle() / degree, (found.position() - truth.position()).norm()};
  }
};

// Two degrees and 2 % of the depth: four pixels of 96. Grey levels are whole numbers, which leaves
// a hundredth of a pixel.
TEST_F(CameraFit, FindsThePose) {
  CameraCorrection off;
  off.turn = Eigen::Vector3d(1, -1.5, 0.8) * degree;
  off.shift = Eigen::Vector3d(0.02, -0.01, 0.02);
  const Fitted found = fit(off, nullptr);
  EXPECT_LT(found.turn, 0.02);
  EXPECT_LT(found.place, 0.002);
}

TEST_F(CameraFit, LeavesOutPixelsThatDoNotCount) {
  Image counted{96, 80, 1, std::vector<uint8_t>(96 * 80, 255)};
  for (int y = 0; y < 80; ++y)
    for (int x = 0; x < 30; ++x) counted.pixels[size_t(96 * y + x)] = 0;
  CameraCorrection off;
  off.turn = Eigen::Vector3d(0.5, 0.5, 0) * degree;
  const Fitted found = fit(off, &counted);
  EXPECT_LT(found.turn, 0.02);
  EXPECT_LT(found.place, 0.002);
}

}  // namespace
}  // namespace gflow
