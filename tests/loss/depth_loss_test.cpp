// SPDX-License-Identifier: Apache-2.0
// The depth loss: the kernel against the reference, pixels that do not count, and the fit of scale
// and shift with outliers. Gradients are in the table of derivatives (tests/stress).
#include "optim/loss/depth_loss.hpp"

#include <cmath>
#include <random>

#include "optim/reference/loss.hpp"
#include "tests/support/compare.hpp"
#include "tests/support/device.hpp"
#include "tests/support/numbers.hpp"

namespace gflow {
namespace {

// A rendered view: mean depth 2 to 8, alpha .2 to 1.
struct DrawnView {
  std::vector<float> depth, alpha, file;

  explicit DrawnView(size_t pixels) {
    std::mt19937 rng(5);
    std::uniform_real_distribution<float> uniform;
    for (size_t i = 0; i < pixels; ++i) {
      alpha.push_back(0.2f + 0.8f * uniform(rng));
      depth.push_back(alpha[i] * (2 + 6 * uniform(rng)));
      file.push_back(depth[i] / alpha[i] * std::exp(0.4f * uniform(rng) - 0.2f));
    }
  }
  float mean_depth(size_t i) const { return depth[i] / alpha[i]; }
};

struct Result {
  std::vector<float> v_depth, v_alpha, fit;
  DepthLossValue value;
};

Result run(const DrawnView& view, DepthFit kind, float weight, float knee, int lanes = 0) {
  Queue queue = test_queue(lanes);
  DepthLoss loss(queue, kind, knee, 3);
  const size_t n = view.depth.size();
  const Buffer<float> depth(queue, view.depth, "depth"), alpha(queue, view.alpha, "alpha");
  const Buffer<float> file(queue, view.file, "file");
  Buffer<float> v_depth(queue, std::vector<float>(n, 7), "v_depth");
  Buffer<float> v_alpha(queue, std::vector<float>(n, -2), "v_alpha");
  loss.fit(queue, 1, n, depth, alpha, file);
  loss.run(queue, weight, 1, n, depth, alpha, file, v_depth, v_alpha);
  Result out{v_depth.read(queue), v_alpha.read(queue), loss.fits().read_range(queue, 4, 4),
             loss.value(queue)};
  for (size_t i = 0; i < n; ++i) out.v_depth[i] -= 7, out.v_alpha[i] += 2;
  return out;
}

std::vector<double> doubles(const std::vector<float>& x) { return {x.begin(), x.end()}; }

class DepthLossLanes : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(All, DepthLossLanes, testing::Values(16, 8, 4, 1));

TEST_P(DepthLossLanes, MatchTheReferenceAtEverySizeAndAddTheirGradients) {
  for (const size_t pixels : {1, 15, 33, 1000}) {
    DrawnView view(pixels);
    if (pixels > 1) view.file[1] = NOT_A_NUMBER;
    const std::vector<double> alpha = doubles(view.alpha);
    const auto want = reference::depth_loss(doubles(view.depth), alpha, alpha, doubles(view.file),
                                            double(pixels), 0.1);
    const Result actual = run(view, DepthFit::none, float(pixels), 0.1f, GetParam());
    // the sums 7 + v are rounded to 2^-22
    EXPECT_TRUE(all_close(actual.v_depth, want.v_depth, {1e-5, 1e-6}));
    EXPECT_TRUE(all_close(actual.v_alpha, want.v_alpha, {1e-5, 1e-6}));
    EXPECT_NEAR(actual.value.loss, want.loss, 1e-5 * want.loss);
    EXPECT_EQ(actual.value.pixels, double(pixels > 1 ? pixels - 1 : pixels));
  }
}

TEST(DepthLoss, IsTheRelativeErrorWeightedByAlpha) {
  DrawnView view(1);
  view.alpha = {0.5f};
  view.depth = {2};  // mean depth 4
  view.file = {4 * std::exp(-1.f)};
  const Result actual = run(view, DepthFit::none, 3, 0.75f);
  // log(4 / file) = 1; sqrt(1 + .5625) = 1.25
  EXPECT_NEAR(actual.value.error, 1, 1e-6);
  EXPECT_NEAR(actual.value.loss, 3 * 0.5 * (1.25 - 0.75), 1e-6);
}

TEST(DepthLoss, CountsNoPixelWithoutDepthOrFile) {
  DrawnView view(6);
  view.depth[0] = view.alpha[0] = 0;  // nothing is drawn
  view.file[1] = NOT_A_NUMBER;
  view.file[2] = INFINITE;
  view.file[3] = -1;
  view.file[4] = 0;
  const Result actual = run(view, DepthFit::none, 1, 0.1f);
  EXPECT_EQ(actual.value.pixels, 1);
  for (size_t i = 0; i < 5; ++i) {
    EXPECT_EQ(actual.v_depth[i], 0) << i;
    EXPECT_EQ(actual.v_alpha[i], 0) << i;
  }
  EXPECT_NE(actual.v_depth[5], 0);
}

// Files of mean 0 and deviation near 1 whose scale and shift are known, with a tenth of outliers.
TEST_P(DepthLossLanes, FindScaleAndShiftInSpiteOfOutliers) {
  for (const DepthFit kind : {DepthFit::depth, DepthFit::disparity}) {
    DrawnView view(2000);
    const double scale = kind == DepthFit::depth ? 1.7 : 0.09;
    const double shift = kind == DepthFit::depth ? 5 : 0.27;
    for (size_t i = 0; i < view.file.size(); ++i) {
      const double z = double(view.mean_depth(i));
      const double y = kind == DepthFit::depth ? z : 1 / z;
      view.file[i] = float((y - shift) / scale);
      if (i % 10 == 0) view.file[i] = 30;
    }
    const Result actual = run(view, kind, 1, 0.05f, GetParam());
    EXPECT_EQ(actual.fit[3], 1);
    // Cauchy's weights leave a hundredth of the outliers' pull.
    EXPECT_NEAR(actual.fit[0], scale, 0.05 * scale);
    EXPECT_NEAR(actual.fit[1], shift, 0.05 * shift);
    size_t pulled = 0;  // pixels whose error is beyond the knee
    for (size_t i = 0; i < view.file.size(); ++i) pulled += std::fabs(actual.v_alpha[i]) > 0.35e-3f;
    EXPECT_NEAR(double(pulled), 200, 40);
  }
}

// Least squares whose weights follow from the fit before.
TEST(DepthLoss, FitsAsTheReferenceWithoutOutliers) {
  DrawnView view(500);
  for (float& x : view.file) x = (x - 5) / 2;
  std::vector<double> y;
  for (size_t i = 0; i < view.file.size(); ++i)
    y.push_back(double(view.depth[i]) / double(view.alpha[i]));
  std::vector<double> weights = doubles(view.alpha);
  reference::LineFit want;
  double mean = 0;
  for (int round = 0; round < 8; ++round) {
    std::vector<double> w = weights;
    for (size_t i = 0; i < w.size(); ++i) w[i] *= depth_file_weight(double(view.file[i]));
    if (round > 0)
      for (size_t i = 0; i < w.size(); ++i)
        w[i] *= depth_fit_weight((want.scale * double(view.file[i]) + want.shift - y[i]) / mean);
    want = reference::line_fit(doubles(view.file), y, w);
    double sum = 0, total = 0;
    for (size_t i = 0; i < w.size(); ++i) sum += w[i] * y[i], total += w[i];
    mean = sum / total;
  }
  const Result actual = run(view, DepthFit::depth, 1, 0.05f);
  EXPECT_NEAR(actual.fit[0], want.scale, 1e-5 * want.scale);  // sums of 500 floats
  EXPECT_NEAR(actual.fit[1], want.shift, 1e-5 * want.shift);
}

TEST(DepthLoss, HasNoFitWhereTheViewSaysNothing) {
  DrawnView view(300);
  DrawnView flat = view, against = view, few = view;
  flat.file.assign(300, 0.f);
  for (size_t i = 0; i < 300; ++i) against.file[i] = -view.mean_depth(i);
  for (size_t i = 10; i < 300; ++i) few.file[i] = NOT_A_NUMBER;
  for (const DrawnView& nothing : {flat, against, few}) {
    const Result actual = run(nothing, DepthFit::depth, 1, 0.1f);
    EXPECT_EQ(actual.fit[3], 0);
    EXPECT_EQ(actual.value.pixels, 0);
    EXPECT_EQ(actual.value.loss, 0);
    for (const float v : actual.v_depth) EXPECT_EQ(v, 0);
  }
}

// An image keeps its fit where only a part of it is rendered; others have their own.
TEST(DepthLoss, UsesTheLastFitOfTheImage) {
  Queue queue = test_queue();
  DrawnView view(400);
  for (size_t i = 0; i < 400; ++i) view.file[i] = (view.mean_depth(i) - 5) / 2;
  DepthLoss loss(queue, DepthFit::depth, 0.1f, 2);
  const Buffer<float> depth(queue, view.depth, "depth"), alpha(queue, view.alpha, "alpha");
  const Buffer<float> file(queue, view.file, "file");
  Buffer<float> v(queue, std::vector<float>(400, 0), "v");
  loss.fit(queue, 1, 400, depth, alpha, file);
  loss.run(queue, 1, 1, 100, depth, alpha, file, v, v);
  EXPECT_EQ(loss.value(queue).pixels, 100);
  EXPECT_LT(loss.value(queue).error, 1e-5);
  loss.run(queue, 1, 0, 100, depth, alpha, file, v, v);
  EXPECT_EQ(loss.value(queue).pixels, 0);
}

TEST(DepthLoss, RefusesWhatItCannotUse) {
  Queue queue = test_queue();
  EXPECT_THROW(DepthLoss(queue, DepthFit::none, 0, 1), Error);
  DepthLoss loss(queue, DepthFit::none, 0.1f, 1);
  EXPECT_THROW(loss.value(queue), Error);
  Buffer<float> four(queue, 4, "four"), three(queue, 3, "three");
  EXPECT_THROW(loss.run(queue, 1, 0, 4, four, four, three, four, four), Error);
  EXPECT_THROW(loss.run(queue, 1, 0, 4, four, four, four, three, four), Error);
}

}  // namespace
}  // namespace gflow
