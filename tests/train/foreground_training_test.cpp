// SPDX-License-Identifier: Apache-2.0
// Masks of the foreground: its pixels matter more in the image loss.
#include "optim/eval/evaluation.hpp"
#include "optim/train/train.hpp"
#include "tests/support/on_one_scene.hpp"
#include "tests/support/scene_in_memory.hpp"

namespace gflow {
namespace {

class Foreground : public OnOneScene {
 protected:
  // The middle ninth of each image is foreground.
  Scene with_masks(const TrainOptions& config, Masks masks) {
    const auto change = [&](Frame& frame, const Image& image, bool) {
      Image mask{image.width, image.height, 1, {}};
      for (int y = 0; y < image.height; ++y)
        for (int x = 0; x < image.width; ++x)
          mask.pixels.push_back(3 * x / image.width == 1 && 3 * y / image.height == 1 ? 255 : 0);
      frame.mask_path = folder_.file(frame.name + ".png");
      write_png(frame.mask_path, mask);
    };
    return in_memory(load_scene(config.scene, ""), change, masks);
  }

  // PSNR of the foreground of the training images.
  double psnr_inside(float weight) {
    TrainOptions config = small_config(scene(), 800);
    config.flow.enabled = false;
    config.density.enabled = false;
    config.train.focus = 0;
    config.loss.foreground = weight;
    Model model(queue(), train(queue(), with_masks(config, Masks::foreground), config).model);
    const LoadedScene loaded =
        with_frames(with_masks(config, Masks::ignore), config.scene, folder_.file("frames"));
    return evaluate(queue(), model, config, loaded, loaded.scene.train, {}).mean.psnr;
  }

  TemporaryFolder folder_;
};

// Measured: 19.5, 25.0 and 27.5 dB with weights 0.1, 1 and 10.
TEST_F(Foreground, IsBetterTheMoreItWeighs) {
  const double alike = psnr_inside(1);
  EXPECT_GT(psnr_inside(10), alike + 1);
  EXPECT_LT(psnr_inside(0.1f), alike - 2);
}

}  // namespace
}  // namespace gflow
