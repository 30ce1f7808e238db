// SPDX-License-Identifier: Apache-2.0
// The image loss: the double reference against central differences, the kernels against it.
#include "optim/loss/image_loss.hpp"

#include <cmath>
#include <random>
#include <string>

#include "optim/loss/metrics.hpp"
#include "optim/reference/device_scene.hpp"
#include "optim/reference/loss.hpp"
#include "tests/support/compare.hpp"
#include "tests/support/device.hpp"

namespace gflow {
namespace {

struct ImageCase {
  int width, height;
  std::vector<float> rgb;       // [3, H, W]
  std::vector<cl_uchar> truth;  // [H, W, 3]
};

// A truth with smooth shades, texture and flat white, and an image that differs by up to `error`.
ImageCase random_case(int width, int height, float error, unsigned seed = 1) {
  std::mt19937 rng(seed);
  std::uniform_real_distribution<float> uniform(-1, 1);
  ImageCase c{width, height, std::vector<float>(size_t(3) * width * height), {}};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int k = 0; k < 3; ++k) {
        float value = 0.5f + 0.3f * std::sin(0.05f * x + 0.03f * y + k);
        if (x / 24 % 3 == 1) value += 0.2f * uniform(rng);
        if (x / 24 % 3 == 2) value = 1;
        c.truth.push_back(cl_uchar(std::lround(255 * std::clamp(value, 0.f, 1.f))));
        c.rgb[(size_t(k) * height + y) * width + x] =
            std::clamp(c.truth.back() / 255.f + error * uniform(rng), 0.f, 1.f);
      }
  return c;
}

std::vector<double> in_double(const std::vector<float>& values) {
  return {values.begin(), values.end()};
}

struct ImageResult {
  std::vector<float> v_rgb;
  ImageLossValue value;
};

ImageResult run(Queue& queue, ImageLoss& loss, const ImageCase& c) {
  const Buffer<float> rgb(queue, c.rgb, "rgb");
  const Buffer<cl_uchar> truth(queue, c.truth, "truth");
  Buffer<float> v_rgb(queue, c.rgb.size(), "v_rgb");
  v_rgb.fill(queue, 7);  // must be overwritten
  loss.run(queue, c.width, c.height, rgb, truth, v_rgb);
  return {v_rgb.read(queue), loss.value(queue)};
}

ImageResult run(int lanes, const ImageCase& c, float ssim_weight) {
  Queue queue = test_queue(lanes);
  ImageLoss loss(queue, ssim_weight);
  return run(queue, loss, c);
}

TEST(ImageLossReference, GradientIsTheCentralDifference) {
  const ImageCase c = random_case(14, 9, 0.2f);
  const std::vector<double> x = in_double(c.rgb);
  for (const double ssim_weight : {0.0, 0.2, 1.0}) {
    const auto f = [&](const std::vector<double>& rgb) {
      return reference::image_loss(c.width, c.height, rgb, c.truth, ssim_weight).total;
    };
    std::vector<double> numeric = numeric_gradient(f, x, 1e-6);
    const std::vector<double> v_rgb =
        reference::image_loss(c.width, c.height, x, c.truth, ssim_weight).v_rgb;
    for (size_t i = 0; i < x.size(); ++i)  // at equal values L1 has a kink
      if (x[i] == c.truth[i % (x.size() / 3) * 3 + i / (x.size() / 3)] / 255.0)
        numeric[i] = v_rgb[i];
    double largest = 0;
    for (const double v : v_rgb) largest = std::max(largest, std::fabs(v));
    // differences: rounding 1e-16 / 1e-6 = 1e-10 absolute, against gradients of 1e-3
    EXPECT_TRUE(all_close(v_rgb, numeric, {1e-6, 1e-6 * largest})) << "weight " << ssim_weight;
  }
}

TEST(ImageLossReference, HasTheSsimOfTheTextbook) {
  const ImageCase c = random_case(31, 22, 0.3f);
  const double expected = ssim(PlanarImage::from_planes(c.width, c.height, c.rgb),
                               PlanarImage::from_bytes(c.width, c.height, c.truth));
  const auto result = reference::image_loss(c.width, c.height, in_double(c.rgb), c.truth, 1);
  EXPECT_NEAR(result.ssim, expected, 1e-12);
}

class ImageLossLanes : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(All, ImageLossLanes, testing::Values(16, 8, 4, 1));

TEST_P(ImageLossLanes, MatchTheReferenceAtEverySize) {
  const int sizes[][2] = {{1, 1}, {17, 15}, {5, 300}, {320, 96}, {64, 64}, {16, 65}};
  for (const auto& [width, height] : sizes)
    for (const float error : {0.3f, 0.02f})
      for (const float ssim_weight : {0.2f, 1.0f}) {
        const std::string at = std::to_string(width) + "x" + std::to_string(height) + " error " +
                               std::to_string(error) + " weight " + std::to_string(ssim_weight);
        const ImageCase c = random_case(width, height, error);
        const auto expected =
            reference::image_loss(width, height, in_double(c.rgb), c.truth, double(ssim_weight));
        const ImageResult actual = run(GetParam(), c, ssim_weight);
        // A variance is a windowed square minus the square of a mean: both are up to 1 in flat
        // white and rounded to 6e-8 a few times, against a sum of variances + C2 of at least 1e-3.
        // The worst of these cases has 7.5e-6, most have 1e-6.
        EXPECT_LE(relative_l2(actual.v_rgb, expected.v_rgb), 1e-5) << at;
        EXPECT_NEAR(actual.value.l1, expected.l1, 1e-6) << at;
        EXPECT_NEAR(actual.value.ssim, expected.ssim, 1e-5) << at;
        EXPECT_NEAR(actual.value.total, expected.total, 1e-5) << at;
      }
}

TEST_P(ImageLossLanes, WithoutSsimGiveTheSignOfTheDifference) {
  const ImageCase c = random_case(37, 21, 0.1f);
  const ImageResult actual = run(GetParam(), c, 0);
  const size_t pixels = c.rgb.size() / 3;
  std::vector<float> expected(c.rgb.size());
  for (size_t i = 0; i < expected.size(); ++i) {
    const float d = c.rgb[i] - c.truth[i % pixels * 3 + i / pixels] / 255.f;
    expected[i] = float((d > 0) - (d < 0)) * float(1 / double(c.rgb.size()));
  }
  EXPECT_EQ(actual.v_rgb, expected);
  EXPECT_TRUE(std::isnan(actual.value.ssim));
  EXPECT_EQ(actual.value.total, actual.value.l1);
}

TEST_P(ImageLossLanes, GiveTheSameBitsTwiceAndWhenTheSizeChangedBetween) {
  const ImageCase small = random_case(19, 70, 0.1f), large = random_case(90, 33, 0.1f);
  Queue queue = test_queue(GetParam());
  ImageLoss loss(queue, 0.2f);
  const ImageResult first = run(queue, loss, small);
  run(queue, loss, large);
  const ImageResult second = run(queue, loss, small);
  EXPECT_EQ(first.v_rgb, second.v_rgb);
  EXPECT_EQ(first.value.total, second.value.total);
}

TEST(ImageLoss, IsZeroWithItsGradientWhereAllBytesAreMet) {
  // Every byte value, decoded by an exact division, equals the kernel's decoding exactly.
  ImageCase c{16, 16, std::vector<float>(3 * 256), std::vector<cl_uchar>(3 * 256)};
  for (size_t i = 0; i < 256; ++i)
    for (size_t k = 0; k < 3; ++k) {
      c.truth[3 * i + k] = cl_uchar(i);
      c.rgb[256 * k + i] = float(i) / 255.f;
    }
  const ImageResult actual = run(0, c, 0);
  EXPECT_EQ(actual.v_rgb, std::vector<float>(c.rgb.size(), 0.f));
  EXPECT_EQ(actual.value.l1, 0);
}

TEST(ImageLoss, OfEqualImagesIsZero) {
  ImageCase c = random_case(50, 40, 0);
  const ImageResult actual = run(0, c, 0.2f);
  EXPECT_NEAR(actual.value.total, 0, 1e-6);
  for (const float v : actual.v_rgb) EXPECT_EQ(v, 0);
}

TEST(ImageLoss, RefusesWhatItCannotUse) {
  Queue queue = test_queue();
  EXPECT_THROW(ImageLoss(queue, -0.1f), Error);
  EXPECT_THROW(ImageLoss(queue, NAN), Error);
  ImageLoss loss(queue, 0.2f);
  EXPECT_THROW(loss.value(queue), Error);
  Buffer<float> rgb(queue, 12, "rgb"), v_rgb(queue, 12, "v_rgb");
  const Buffer<cl_uchar> truth(queue, 11, "truth");
  EXPECT_THROW(loss.run(queue, 2, 2, rgb, truth, v_rgb), Error);
  EXPECT_THROW(loss.run(queue, 0, 2, rgb, truth, v_rgb), Error);
}

}  // namespace
}  // namespace gflow
