// SPDX-License-Identifier: Apache-2.0
// Metrics against values computed by hand or by NumPy, never by gflow's kernels.
#include "optim/loss/metrics.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "runtime/base/error.hpp"

namespace gflow {
namespace {

// The two images of the NumPy script below.
PlanarImage wavy(int y_step, int c_step) {
  std::vector<uint8_t> bytes;
  for (int y = 0; y < 13; ++y)
    for (int x = 0; x < 19; ++x)
      for (int c = 0; c < 3; ++c)
        bytes.push_back(uint8_t(x * 37 + y * y_step + c * c_step + x * y));
  return PlanarImage::from_bytes(19, 13, bytes);
}

// import numpy as np
// y, x, c = np.mgrid[0:13, 0:19, 0:3]
// a = ((x * 37 + y * 11 + c * 5 + x * y) % 256) / 255.0
// b = ((x * 37 + y * 12 + c * 9 + x * y) % 256) / 255.0
// k = np.arange(-5, 6); g = np.exp(-k**2 / 4.5); g /= g.sum()
// def blur(p):  # zero outside
//     p = np.apply_along_axis(np.convolve, 0, np.pad(p, 5), g, 'valid')
//     return np.apply_along_axis(np.convolve, 1, p, g, 'valid')
// s = []
// for i in range(3):
//     p, q = a[..., i], b[..., i]
//     m, n = blur(p), blur(q)
//     v, w, r = blur(p*p) - m*m, blur(q*q) - n*n, blur(p*q) - m*n
//     s.append((2*m*n + 1e-4) * (2*r + 9e-4) / ((m*m + n*n + 1e-4) * (v + w + 9e-4)))
// print(repr(np.mean(s)), repr(10 * np.log10(1 / np.mean((a - b)**2))))
constexpr double NUMPY_SSIM = 0.8664152735513486;
constexpr double NUMPY_PSNR = 15.401106607966708;

TEST(Ssim, IsWhatNumpyGivesInFloat64) {
  // The same sums in another order: about a hundred roundings of 1e-16.
  EXPECT_NEAR(ssim(wavy(11, 5), wavy(12, 9)), NUMPY_SSIM, 1e-12);
}

// Where the window is inside the image, pixels outside do not matter, and structural_similarity of
// scikit-image 0.19.3 averages over those positions:
// structural_similarity(a, b, channel_axis=2, gaussian_weights=True, sigma=1.5,
//                       use_sample_covariance=False, data_range=1.0)
TEST(Ssim, WithinTheImageIsThatOfScikitImage) {
  std::vector<uint8_t> inside;
  for (int y = 0; y < 13; ++y)
    for (int x = 0; x < 19; ++x) inside.push_back(x >= 5 && x < 14 && y >= 5 && y < 8);
  EXPECT_NEAR(ssim(wavy(11, 5), wavy(12, 9), inside), 0.8303480614801962, 1e-12);
}

TEST(Ssim, OfNoPixelIsNotANumber) {
  EXPECT_TRUE(std::isnan(ssim(wavy(11, 5), wavy(12, 9), std::vector<uint8_t>(size_t{13} * 19, 0))));
}

TEST(Ssim, IsTheMeanOfItsMap) {
  const std::vector<double> map = ssim_map(wavy(11, 5), wavy(12, 9));
  ASSERT_EQ(map.size(), size_t{13} * 19);
  EXPECT_NEAR(mean_of_map(map), NUMPY_SSIM, 1e-12);
  EXPECT_EQ(mean_of_map({1, 2, 30}, {255, 1, 0}), 1.5);
}

TEST(Ssim, OfEqualImagesIsOne) { EXPECT_NEAR(ssim(wavy(11, 5), wavy(11, 5)), 1, 1e-14); }

TEST(Psnr, IsWhatNumpyGivesInFloat64) {
  EXPECT_NEAR(psnr(wavy(11, 5), wavy(12, 9)), NUMPY_PSNR, 1e-12);
}

TEST(Psnr, OfADifferenceOfATenthIsTwentyDecibel) {
  const PlanarImage a = PlanarImage::from_planes(2, 1, {0.5f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f});
  PlanarImage b = a;
  for (double& value : b.values) value += 0.1;
  EXPECT_NEAR(psnr(a, b), 20, 1e-12);
}

TEST(Psnr, CountsOnlyTheMask) {
  const PlanarImage a = PlanarImage::from_planes(2, 1, {0.5f, 0, 0.5f, 0, 0.5f, 0});
  PlanarImage b = a;
  for (size_t c = 0; c < 3; ++c) b.values[2 * c] += 0.01;  // the left pixel
  b.values[1] = 1;                                         // the right pixel
  EXPECT_NEAR(psnr(a, b, {255, 0}), 40, 1e-9);
  EXPECT_TRUE(std::isnan(psnr(a, b, {0, 0})));
}

TEST(Psnr, OfEqualImagesIsInfinite) {
  EXPECT_EQ(psnr(wavy(1, 1), wavy(1, 1)), std::numeric_limits<double>::infinity());
}

TEST(Psnr, RefusesImagesOfDifferentSize) {
  const PlanarImage a = PlanarImage::from_planes(1, 1, {0, 0, 0});
  EXPECT_THROW(psnr(a, wavy(1, 1)), Error);
}

TEST(ColorMatched, UndoesExposureAndWhiteBalance) {
  PlanarImage truth = wavy(11, 5), image = truth;
  const size_t pixels = 19 * 13;
  for (size_t i = 0; i < pixels; ++i) {
    for (size_t c = 0; c < 3; ++c)
      image.values[c * pixels + i] = 0.1 + 0.5 * truth.values[c * pixels + i];
    image.values[i] += 0.2 * truth.values[pixels + i];
  }
  EXPECT_LT(psnr(image, truth), 30);
  EXPECT_GT(psnr(color_matched(image, truth), truth), 200);  // rounding in double
  // A pixel that does not count has no say.
  std::vector<uint8_t> mask(pixels, 1);
  mask[7] = 0;
  image.values[7] = 1;
  EXPECT_GT(psnr(color_matched(image, truth, mask), truth, mask), 200);
}

TEST(ColorMatched, OfOneColourIsTheMeanOfTheTruth) {
  const PlanarImage truth{2, 1, {0.2, 0.4, 0.5, 0.7, 0.1, 0.1}};
  const PlanarImage matched = color_matched({2, 1, std::vector<double>(6, 0.5)}, truth);
  const double mean[] = {0.3, 0.6, 0.1};
  for (size_t k = 0; k < 6; ++k) EXPECT_NEAR(matched.values[k], mean[k / 2], 1e-12);
}

TEST(PlanarImage, IsCutToTheRangeOfAFile) {
  const PlanarImage a = PlanarImage::from_planes(1, 1, {-1, 0.25f, 2});
  EXPECT_EQ(a.values, (std::vector<double>{0, 0.25, 1}));
}

TEST(PlanarImage, TakesBytesInterleaved) {
  const PlanarImage a = PlanarImage::from_bytes(2, 1, {0, 51, 102, 153, 204, 255});
  EXPECT_EQ(a.values, (std::vector<double>{0, 0.6, 0.2, 0.8, 0.4, 1}));
}

TEST(FlowMetrics, AreTheHandMadeOnes) {
  // Errors: (3, 4) = 5 px, static; 4 px of 100 px = 4 %; 0; the last pixel has no truth.
  const std::vector<float> truth = {0, 100, 7, std::numeric_limits<float>::quiet_NaN(), 0, 0, 7, 0};
  const std::vector<float> flow = {3, 104, 7, 1000, 4, 0, 7, 1000};
  const FlowMetrics all = flow_metrics(flow, truth);
  EXPECT_EQ(all.pixels, 3u);
  EXPECT_DOUBLE_EQ(all.epe, 3);
  EXPECT_DOUBLE_EQ(all.fl_all, 1.0 / 3);
  const FlowMetrics some = flow_metrics(flow, truth, {0, 1, 1, 1});
  EXPECT_EQ(some.pixels, 2u);
  EXPECT_DOUBLE_EQ(some.epe, 2);
  EXPECT_DOUBLE_EQ(some.fl_all, 0);
}

TEST(FlowMetrics, OfNoPixelAreNotANumber) {
  EXPECT_TRUE(std::isnan(flow_metrics({1, 1}, {0, 0}, {0}).epe));
}

constexpr float NAN_F = std::numeric_limits<float>::quiet_NaN();

TEST(DepthError, IsTheHandMadeOne) {
  // Depths: 2 of 2; 5 of 4; 3.75 of 5; nothing rendered; two without a surface.
  const std::vector<float> truth = {2, 4, 5, 3, 0, NAN_F};
  const std::vector<float> depth = {1, 5, 3, 0.009f, 7, 7};
  const std::vector<float> alpha = {0.5f, 1, 0.8f, 0.003f, 1, 1};
  EXPECT_NEAR(depth_error(depth, alpha, truth), (0 + 0.25 + 0.25 + 1) / 4, 1e-7);
}

TEST(DepthError, OfNoSurfaceIsNotANumber) {
  EXPECT_TRUE(std::isnan(depth_error({1, 1}, {1, 1}, {0, -1})));
}

TEST(DepthError, RefusesOtherSizes) { EXPECT_THROW(depth_error({1}, {1, 1}, {1, 1}), Error); }

// Planes of 3 x 2 pixels with one value everywhere except the listed elements.
std::vector<float> planes(float all, const std::vector<std::pair<size_t, float>>& others = {}) {
  std::vector<float> values(3 * 6, all);
  for (const auto& [i, value] : others) values[i] = value;
  return values;
}

TEST(Difference, IsTheImageLessItsTruth) {
  const PlanarImage a = PlanarImage::from_planes(1, 1, {0.5f, 0, 1});
  const PlanarImage b = PlanarImage::from_planes(1, 1, {0.25f, 1, 1});
  EXPECT_EQ(difference(a, b), (std::vector<float>{0.25f, -1, 0}));
}

TEST(Flicker, IsNothingWhereTheErrorStays) {
  EXPECT_EQ(flicker(planes(0.25f), planes(0.25f), 3, 2, std::vector<float>(12, 0.f)), 0);
}

TEST(Flicker, IsTheMeanChangeOfTheErrorInGreyLevels) {
  // One of 18 values changes by -0.5, one by 0.25.
  const std::vector<float> next = planes(0.25f, {{4, -0.25f}, {17, 0.5f}});
  EXPECT_NEAR(flicker(planes(0.25f), next, 3, 2, std::vector<float>(12, 0.f)), 255 * 0.75 / 18,
              1e-12);
  // Only the first of them is in its pixel, the fifth.
  EXPECT_NEAR(flicker(planes(0.25f), next, 3, 2, std::vector<float>(12, 0.f), {0, 0, 0, 0, 255, 0}),
              255 * 0.5 / 3, 1e-12);
}

TEST(Flicker, FollowsTheFlow) {
  // The error moves from pixel (0, 0) to half way between (1, 1) and (2, 1): a sharp spot in the
  // first image, half its strength in both pixels of the next.
  const std::vector<float> error = planes(0, {{0, 0.5f}, {6, 0.5f}, {12, 0.5f}});
  std::vector<float> next = planes(0);
  for (size_t c = 0; c < 3; ++c) next[6 * c + 4] = next[6 * c + 5] = 0.5f;
  std::vector<float> flow(12, 0.f);
  flow[0] = 1.5f;
  flow[6] = 1;
  const std::vector<uint8_t> spot = {1, 0, 0, 0, 0, 0};
  EXPECT_NEAR(flicker(error, next, 3, 2, flow, spot), 0, 1e-12);
  flow[6] = 0.75f;  // a quarter of the row above, which is 0
  EXPECT_NEAR(flicker(error, next, 3, 2, flow, spot), 255 * 0.125, 1e-12);
  // A quarter of the distance from a pixel to its right neighbour.
  flow[0] = 0.25f;
  flow[6] = 0;
  EXPECT_NEAR(flicker(planes(0), planes(0, {{1, 0.5f}}), 3, 2, flow, spot), 255 * 0.125 / 3, 1e-12);
}

TEST(Flicker, LeavesOutWhatLeavesTheImage) {
  std::vector<float> flow(12, 0.f);
  for (const size_t i : {0, 1, 3, 4}) flow[i] = NAN_F;
  flow[2] = 0.5f;   // right of the last column
  flow[11] = 0.5f;  // below the last row
  EXPECT_TRUE(std::isnan(flicker(planes(0), planes(1), 3, 2, flow)));
  flow[2] = -0.5f;
  EXPECT_NEAR(flicker(planes(0), planes(1), 3, 2, flow), 255, 1e-12);
}

TEST(Flicker, RefusesOtherSizes) {
  EXPECT_THROW(flicker(planes(0), planes(0), 3, 2, {0, 0}), Error);
  EXPECT_THROW(flicker(planes(0), {0, 0, 0}, 3, 2, std::vector<float>(12)), Error);
}

}  // namespace
}  // namespace gflow
