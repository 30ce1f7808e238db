// SPDX-License-Identifier: Apache-2.0
#include "optim/train/poor_scene.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "optim/scene/loaded_scene.hpp"
#include "runtime/base/warning.hpp"

namespace gflow {
namespace {

// Grey noise about a level; normal, as that of a sensor.
Image noisy(int level, double sigma, uint32_t seed) {
  Image image{160, 120, 3, std::vector<uint8_t>(size_t(160 * 120 * 3))};
  std::mt19937 bits(seed);
  std::normal_distribution<double> noise(level, sigma);
  for (uint8_t& value : image.pixels) value = uint8_t(std::clamp(noise(bits), 0., 255.));
  return image;
}

Image with_square(Image image, int side, uint8_t level) {
  for (int y = 20; y < 20 + side; ++y)
    for (int x = 3 * 30; x < 3 * (30 + side); ++x)
      image.pixels[size_t(y * image.width * 3 + x)] = level;
  return image;
}

// A still camera, or photographs at one time by several.
Scene video_of(const std::vector<Image>& images, bool photographs = false) {
  Scene scene;
  scene.name = "made";
  for (size_t k = 0; k < images.size(); ++k) {
    if (k == 0 || photographs) {
      Camera camera;
      camera.width = images[k].width, camera.height = images[k].height;
      camera.fx = camera.fy = 100, camera.cx = 80, camera.cy = 60;
      camera.viewmat.topRightCorner<3, 1>() = Eigen::Vector3d(double(k), 0, 5);
      scene.cameras.push_back(camera);
    }
    Frame frame;
    frame.camera = frame.track = photographs ? int(k) : 0;
    frame.time = photographs || images.size() == 1 ? 0 : double(k) / double(images.size() - 1);
    frame.image = std::make_shared<const Image>(images[k]);
    scene.train.push_back(frame);
  }
  complete_scene(scene);
  return scene;
}

std::string warnings_of(const Scene& scene) {
  std::string all;
  const WarningsTo here([&](const std::string& sentence) { all += sentence + "\n"; });
  const LoadedScene loaded = with_frames(scene, {}, "");
  warn_of_poor_scene(loaded.scene, *loaded.frames);
  return all;
}

std::vector<Image> noise_of(size_t count, int level, double sigma) {
  std::vector<Image> images;
  for (size_t k = 0; k < count; ++k) images.push_back(noisy(level, sigma, uint32_t(k)));
  return images;
}

TEST(PoorScene, ImagesOfOneColorShowNothing) {
  EXPECT_EQ(warnings_of(video_of(noise_of(12, 0, 0))),
            "the images of made are all of one colour: neither shape nor motion can be learned, "
            "whatever the PSNR\n");
  EXPECT_NE(warnings_of(video_of(noise_of(12, 5, 4))), "");  // black with the noise of a sensor
  std::vector<Image> fading;
  for (int k = 0; k < 12; ++k) fading.push_back(noisy(20 * k, 0, 0));
  EXPECT_NE(warnings_of(video_of(fading)), "");
}

TEST(PoorScene, SomethingSmallInADarkVideoIsEnough) {
  std::vector<Image> images = noise_of(12, 5, 4);
  for (Image& image : images) image = with_square(image, 6, 40);
  EXPECT_EQ(warnings_of(video_of(images)), "");
  std::vector<Image> begins_black = noise_of(12, 0, 0);
  for (size_t k = 6; k < 12; ++k) begins_black[k] = images[k];
  EXPECT_EQ(warnings_of(video_of(begins_black)), "");
}

TEST(PoorScene, FewTimesOfOneCameraTellNoMotion) {
  std::vector<Image> images;
  for (const Image& image : noise_of(4, 5, 4)) images.push_back(with_square(image, 30, 200));
  EXPECT_EQ(warnings_of(video_of(images)), "");
  EXPECT_EQ(warnings_of(video_of(images, true)), "");  // photographs
  images.resize(2);
  EXPECT_EQ(warnings_of(video_of(images)),
            "the images of made show only 2 distinct times: too few to learn or check motion, "
            "whatever the PSNR\n");
  EXPECT_EQ(warnings_of(video_of(images, true)), "");
}

// The shape of what is cut out shows even where it has one colour.
TEST(PoorScene, ObjectsCutOutByAlphaAreFine) {
  std::vector<Image> images;
  for (int k = 0; k < 12; ++k) {
    Image image{160, 120, 4, std::vector<uint8_t>(size_t(160 * 120 * 4), 255)};
    for (size_t i = 3; i < image.pixels.size() / 2; i += 4) image.pixels[i] = 0;
    images.push_back(image);
  }
  Scene scene = video_of(images);
  scene.has_alpha = true;
  EXPECT_EQ(warnings_of(scene), "");
}

}  // namespace
}  // namespace gflow
