// SPDX-License-Identifier: Apache-2.0
// The flow loss: edge cases of the robust norm, the reference against central differences, the
// kernel against the reference, and masked pixels exactly 0.
#include "optim/loss/flow_loss.hpp"

#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "optim/reference/loss.hpp"
#include "shared/constants.h"
#include "tests/support/compare.hpp"
#include "tests/support/device.hpp"
#include "tests/support/numbers.hpp"

namespace gflow {
namespace {

struct FlowCase {
  int width, height;
  std::vector<float> flow, alpha, target_flow;
  std::vector<cl_uchar> confidence;
  std::vector<float> tile_weights = {};  // empty: all tiles have weight 1
};

FlowCase random_case(int width, int height) {
  std::mt19937 rng(2);
  std::normal_distribution<float> normal;
  const size_t pixels = size_t(width) * height;
  FlowCase c{width,
             height,
             std::vector<float>(2 * pixels),
             std::vector<float>(pixels),
             std::vector<float>(2 * pixels),
             std::vector<cl_uchar>(pixels)};
  for (float& f : c.flow) f = 3 * normal(rng);
  for (float& f : c.target_flow) f = 3 * normal(rng);
  for (float& a : c.alpha) a = std::min(1.f, std::fabs(normal(rng)));
  for (cl_uchar& m : c.confidence) m = cl_uchar(rng() % 4 ? rng() % 256 : 0);
  return c;
}

// All pixels have full weight: flow and target flow [2, n] in one row.
FlowCase row_of(std::vector<float> flow, std::vector<float> target_flow) {
  const size_t n = flow.size() / 2;
  return {int(n),
          1,
          std::move(flow),
          std::vector<float>(n, 1.f),
          std::move(target_flow),
          std::vector<cl_uchar>(n, 255)};
}

struct FlowResult {
  std::vector<float> v_flow;
  FlowLossValue value;
};

FlowResult run(const FlowCase& c, float weight, float robust_px, int lanes = 0) {
  Queue queue = test_queue(lanes);
  FlowLoss loss(queue, robust_px);
  const Buffer<float> flow(queue, c.flow, "flow"), alpha(queue, c.alpha, "alpha");
  const Buffer<float> target_flow(queue, c.target_flow, "teacher");
  const Buffer<cl_uchar> confidence(queue, c.confidence, "confidence");
  Buffer<float> v_flow(queue, c.flow.size(), "v_flow");
  v_flow.fill(queue, 7);  // must be overwritten
  const Buffer<float> tile_weights(queue, c.tile_weights, "tile weights");
  loss.run(queue, weight, c.width, c.height, flow, alpha, target_flow, confidence, v_flow,
           c.tile_weights.empty() ? nullptr : &tile_weights);
  return {v_flow.read(queue), loss.value(queue)};
}

reference::FlowLossResult expected(const FlowCase& c, double weight, double knee) {
  std::vector<double> confidence(c.confidence.begin(), c.confidence.end());
  const size_t width = size_t(c.width), tiles_x = (width + TILE - 1) / TILE;
  for (size_t i = 0; i < confidence.size(); ++i) {
    confidence[i] /= 255;
    if (!c.tile_weights.empty())
      confidence[i] *= double(c.tile_weights[i / width / TILE * tiles_x + i % width / TILE]);
  }
  return reference::flow_loss({c.flow.begin(), c.flow.end()}, {c.alpha.begin(), c.alpha.end()},
                              {c.target_flow.begin(), c.target_flow.end()}, confidence, weight,
                              knee);
}

TEST(RobustNorm, IsTheFormulaWhereThatIsSafe) {
  EXPECT_NEAR(robust_norm(3, 4, 1), std::sqrt(26.0) - 1, 1e-14);
  EXPECT_NEAR(robust_norm(0.3, -0.4, 2), std::sqrt(4.25) - 2, 1e-14);
}

TEST(FlowLossReference, GradientIsTheCentralDifference) {
  const FlowCase c = random_case(5, 4);
  const std::vector<double> flow(c.flow.begin(), c.flow.end());
  std::vector<double> confidence(c.confidence.begin(), c.confidence.end());
  for (double& m : confidence) m /= 255;
  const auto f = [&](const std::vector<double>& x) {
    return reference::flow_loss(x, {c.alpha.begin(), c.alpha.end()},
                                {c.target_flow.begin(), c.target_flow.end()}, confidence, 0.5, 0.1)
        .loss;
  };
  // differences: rounding 1e-16 / 1e-6 = 1e-10 absolute, against gradients of 1e-2
  EXPECT_TRUE(
      all_close(expected(c, 0.5, 0.1).v_flow, numeric_gradient(f, flow, 1e-6), {1e-6, 1e-9}));
}

class FlowLossLanes : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(All, FlowLossLanes, testing::Values(16, 8, 4, 1));

TEST_P(FlowLossLanes, MatchTheReferenceAtEverySize) {
  const int sizes[][2] = {{1, 1}, {17, 15}, {5, 300}, {320, 96}};
  for (const auto& [width, height] : sizes)
    for (const float knee : {1e-3f, 1.f}) {
      const FlowCase c = random_case(width, height);
      const auto want = expected(c, 0.5, double(knee));
      const FlowResult actual = run(c, 0.5f, knee, GetParam());
      // about 10 roundings of 6e-8 each
      EXPECT_TRUE(all_close(actual.v_flow, want.v_flow, {1e-6, 1e-12}));
      EXPECT_NEAR(actual.value.loss, want.loss, 1e-6 * want.loss);
      EXPECT_EQ(actual.value.confident_pixels, confident_pixels(c.target_flow, c.confidence));
    }
}

// Tiles have weights, 0 or several times 1; the error is a weighted mean.
TEST_P(FlowLossLanes, WeighsEachTile) {
  const int sizes[][2] = {{1, 1}, {17, 15}, {35, 50}, {320, 96}};
  for (const auto& [width, height] : sizes) {
    FlowCase c = random_case(width, height);
    const size_t tiles_x = size_t(width + 15) / 16, tiles = tiles_x * (size_t(height + 15) / 16);
    for (size_t tile = 0; tile < tiles; ++tile)
      c.tile_weights.push_back(tile == 0 ? 4.f : float(tile % 3));
    const auto want = expected(c, 0.5, 0.1);
    const FlowResult actual = run(c, 0.5f, 0.1f, GetParam());
    EXPECT_TRUE(all_close(actual.v_flow, want.v_flow, {1e-6, 1e-12}));
    EXPECT_NEAR(actual.value.loss, want.loss, 1e-6 * want.loss);
    double errors = 0, counted = 0;
    const size_t pixels = c.alpha.size(), w = size_t(width);
    for (size_t i = 0; i < pixels; ++i) {
      const double s = double(c.tile_weights[i / w / 16 * tiles_x + i % w / 16]);
      if (c.confidence[i] == 0) continue;
      counted += s;
      errors += s * std::hypot(double(c.flow[i] - c.target_flow[i]),
                               double(c.flow[pixels + i] - c.target_flow[pixels + i]));
    }
    EXPECT_EQ(actual.value.confident_pixels, counted);
    EXPECT_NEAR(actual.value.epe, counted > 0 ? errors / counted : 0, 1e-5);
  }
}

TEST(FlowLoss, GradientIsFiniteAndNoLongerThanOneForAnyDifference) {
  const std::vector<float> r = {0, 1e-25f, 1e-19f, 1e-3f, 1, 1e5f, 3e19f};
  std::vector<float> flow(r);
  flow.resize(2 * r.size(), 0.f);
  const FlowCase c = row_of(flow, std::vector<float>(2 * r.size(), 0.f));
  for (const float knee : {1e-3f, 1.f}) {
    const FlowResult actual = run(c, float(r.size()), knee);
    EXPECT_EQ(actual.v_flow[0], 0);
    EXPECT_TRUE(all_close(actual.v_flow, expected(c, double(r.size()), double(knee)).v_flow,
                          {1e-6, 1e-38}));
    for (const float v : actual.v_flow) EXPECT_LE(std::fabs(v), 1.f);
  }
}

TEST(FlowLoss, OfOnePixelIsTheHandMadeOne) {
  FlowCase c = row_of({3, 0, 4, 0}, {0, 0, 0, 0});
  c.alpha = {0.5f, 0};
  const FlowResult actual = run(c, 2, 12);
  // sqrt(25 + 144) - 12 = 1; 2 / 2 pixels * alpha .5; derivative (3, 4) / 13 * .5
  EXPECT_NEAR(actual.value.loss, 0.5, 1e-6);
  EXPECT_NEAR(actual.value.epe, 2.5, 1e-6);
  EXPECT_EQ(actual.value.confident_pixels, 2u);
  EXPECT_TRUE(
      all_close(actual.v_flow, std::vector<double>{1.5 / 13, 0, 2. / 13, 0}, {1e-6, 1e-30}));
}

TEST(FlowLoss, IsBitwiseZeroWhereThereIsNoWeight) {
  std::vector<float> target_flow = {1, NOT_A_NUMBER, INFINITE, -2e5f, 1, 1, 1, 1, 1};
  const size_t n = target_flow.size();
  for (const float y : {1.f, 1.f, 1.f, 1.f, 1.f, 1.f, NOT_A_NUMBER, INFINITE, -2e5f})
    target_flow.push_back(y);
  FlowCase c = row_of(std::vector<float>(2 * n, -5.f), target_flow);
  c.confidence[0] = 0;
  c.alpha[4] = 0;
  c.confidence[5] = 0;
  c.flow[5] = NOT_A_NUMBER;  // must not spread through a masked pixel
  const FlowResult actual = run(c, 1, 0.1f);
  const std::vector<float> zero(2 * n, 0.f);
  EXPECT_EQ(std::memcmp(actual.v_flow.data(), zero.data(), 2 * n * sizeof(float)), 0);
  EXPECT_EQ(actual.value.loss, 0);
  EXPECT_EQ(actual.value.confident_pixels, 1u);  // nothing is rendered at pixel 4
  EXPECT_EQ(confident_pixels(c.target_flow, c.confidence), 1u);
}

TEST(FlowLoss, WithoutConfidentPixelsHasNoError) {
  FlowCase c = random_case(8, 3);
  c.confidence.assign(c.confidence.size(), 0);
  const FlowResult actual = run(c, 1, 0.1f);
  EXPECT_EQ(actual.value.loss, 0);
  EXPECT_EQ(actual.value.epe, 0);
  EXPECT_EQ(confident_pixels(c.target_flow, c.confidence), 0u);
}

TEST(FlowLoss, GivesTheSameBitsTwice) {
  const FlowCase c = random_case(61, 47);
  const FlowResult first = run(c, 0.5f, 0.1f), second = run(c, 0.5f, 0.1f);
  EXPECT_EQ(first.v_flow, second.v_flow);
  EXPECT_EQ(first.value.loss, second.value.loss);
  EXPECT_EQ(first.value.epe, second.value.epe);
}

TEST(FlowLoss, RefusesWhatItCannotUse) {
  Queue queue = test_queue();
  EXPECT_THROW(FlowLoss(queue, 0), Error);
  EXPECT_THROW(FlowLoss(queue, NOT_A_NUMBER), Error);
  FlowLoss loss(queue, 0.1f);
  EXPECT_THROW(loss.value(queue), Error);
  Buffer<float> flow(queue, 8, "flow"), alpha(queue, 4, "alpha"), v_flow(queue, 7, "v_flow");
  const Buffer<cl_uchar> confidence(queue, 4, "confidence");
  EXPECT_THROW(loss.run(queue, 1, 2, 2, flow, alpha, flow, confidence, v_flow), Error);
  EXPECT_THROW(confident_pixels({1, 2, 3}, {1, 1}), Error);
  v_flow.ensure(queue, 8);
  const Buffer<float> no_tile(queue, 0, "tile weights");
  EXPECT_THROW(loss.run(queue, 1, 2, 2, flow, alpha, flow, confidence, v_flow, &no_tile), Error);
}

}  // namespace
}  // namespace gflow
