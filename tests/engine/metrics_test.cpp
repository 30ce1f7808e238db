// SPDX-License-Identifier: Apache-2.0
// Metrics against numbers found by hand or by numpy, never against our own kernels.
#include "optim/loss/metrics.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "runtime/error.hpp"

namespace gflow {
namespace {

// The two pictures of the numpy script below.
Picture wavy(int y_step, int c_step) {
  std::vector<uint8_t> bytes;
  for (int y = 0; y < 13; ++y)
    for (int x = 0; x < 19; ++x)
      for (int c = 0; c < 3; ++c)
        bytes.push_back(uint8_t(x * 37 + y * y_step + c * c_step + x * y));
  return Picture::from_bytes(19, 13, bytes);
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
  // the same sums in another order: some hundred roundings of 1e-16
  EXPECT_NEAR(ssim(wavy(11, 5), wavy(12, 9)), NUMPY_SSIM, 1e-12);
}

TEST(Ssim, OfEqualPicturesIsOne) { EXPECT_NEAR(ssim(wavy(11, 5), wavy(11, 5)), 1, 1e-14); }

TEST(Psnr, IsWhatNumpyGivesInFloat64) {
  EXPECT_NEAR(psnr(wavy(11, 5), wavy(12, 9)), NUMPY_PSNR, 1e-12);
}

TEST(Psnr, OfADifferenceOfATenthIsTwentyDecibel) {
  const Picture a = Picture::from_planes(2, 1, {0.5f, 0.5f, 0.5f, 0.5f, 0.5f, 0.5f});
  Picture b = a;
  for (double& value : b.values) value += 0.1;
  EXPECT_NEAR(psnr(a, b), 20, 1e-12);
}

TEST(Psnr, CountsOnlyTheMask) {
  const Picture a = Picture::from_planes(2, 1, {0.5f, 0, 0.5f, 0, 0.5f, 0});
  Picture b = a;
  for (size_t c = 0; c < 3; ++c) b.values[2 * c] += 0.01;  // the left pixel
  b.values[1] = 1;                                         // the right pixel
  EXPECT_NEAR(psnr(a, b, {255, 0}), 40, 1e-9);
  EXPECT_TRUE(std::isnan(psnr(a, b, {0, 0})));
}

TEST(Psnr, OfEqualPicturesIsInfinite) {
  EXPECT_EQ(psnr(wavy(1, 1), wavy(1, 1)), std::numeric_limits<double>::infinity());
}

TEST(Psnr, RefusesPicturesOfDifferentSize) {
  const Picture a = Picture::from_planes(1, 1, {0, 0, 0});
  EXPECT_THROW(psnr(a, wavy(1, 1)), Error);
}

TEST(Picture, IsCutToTheRangeOfAFile) {
  const Picture a = Picture::from_planes(1, 1, {-1, 0.25f, 2});
  EXPECT_EQ(a.values, (std::vector<double>{0, 0.25, 1}));
}

TEST(Picture, TakesBytesInterleaved) {
  const Picture a = Picture::from_bytes(2, 1, {0, 51, 102, 153, 204, 255});
  EXPECT_EQ(a.values, (std::vector<double>{0, 0.6, 0.2, 0.8, 0.4, 1}));
}

TEST(FlowMetrics, AreTheHandMadeOnes) {
  // errors (3, 4) = 5 px at rest; 4 px of 100 px = 4 %; 0; the last has no truth
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

}  // namespace
}  // namespace gflow
