// SPDX-License-Identifier: Apache-2.0
// Masks of pixels to ignore: what an image shows there changes no bit of the model and no metric.
#include "optim/eval/evaluation.hpp"
#include "optim/train/train.hpp"
#include "tests/support/on_one_scene.hpp"
#include "tests/support/scene_in_memory.hpp"

namespace gflow {
namespace {

constexpr int kFirst = 8, kLast = 20;  // [px] the passer-by, in x and y

class Ignored : public OnOneScene {
 protected:
  // The scene in memory with a rectangle of that grey in every second image; masked: under a mask.
  Scene with_passer_by(const TrainOptions& config, uint8_t grey, bool masked) {
    size_t images = 0;
    const auto change = [&](Frame& frame, Image& image, bool) {
      if (images++ % 2 != 0) return;
      Image mask{image.width, image.height, 1, {}};
      mask.pixels.assign(image.pixels.size() / 3, 255);
      for (int y = kFirst; y < kLast; ++y)
        for (int x = kFirst; x < kLast; ++x) {
          const size_t pixel = size_t(y) * size_t(image.width) + size_t(x);
          std::fill_n(&image.pixels[3 * pixel], 3, grey);
          mask.pixels[pixel] = 0;
        }
      if (!masked) return;
      frame.mask_path = folder_.file(frame.name + ".png");
      write_png(frame.mask_path, mask);
    };
    return in_memory(load_scene(config.scene, ""), change, Masks::ignore);
  }
  TrainOptions config() {
    TrainOptions config = small_config(scene(), 60);
    config.flow.enabled = false;  // DIS compares windows that reach under the mask
    return config;
  }

  TemporaryFolder folder_;
};

TEST_F(Ignored, PixelsChangeNoBitOfTheModel) {
  const auto trained = [&](uint8_t grey, bool masked) {
    return train(queue(), with_passer_by(config(), grey, masked), config()).model;
  };
  const HostModel dark = trained(0, true), bright = trained(255, true);
  ASSERT_EQ(dark.count, bright.count);
  for (const auto& [name, values] : dark.groups) EXPECT_EQ(bright.groups.at(name), values) << name;
  const HostModel not_masked = trained(255, false);
  EXPECT_NE(not_masked.groups.at("sh0"), dark.groups.at("sh0"));
}

TEST_F(Ignored, PixelsChangeNoMetric) {
  const HostModel host = train(queue(), with_passer_by(config(), 0, true), config()).model;
  const auto evaluated = [&](uint8_t grey, bool masked) {
    const LoadedScene loaded =
        with_frames(with_passer_by(config(), grey, masked), config().scene, folder_.file("frames"));
    Model model(queue(), host);
    return evaluate(queue(), model, config(), loaded, loaded.scene.train, {}, "", "").mean;
  };
  const ViewMetrics dark = evaluated(0, true), bright = evaluated(255, true);
  EXPECT_EQ(dark.psnr, bright.psnr);
  EXPECT_NEAR(dark.ssim, bright.ssim,
              0.02);  // windows reach under the mask, where images are equal
  EXPECT_LT(evaluated(255, false).psnr, bright.psnr - 1);
}

}  // namespace
}  // namespace gflow
