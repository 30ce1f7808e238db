// SPDX-License-Identifier: Apache-2.0
// Selection of tiles for the flow loss: moving tiles always, low-motion tiles with their
// probability, so that the mean over many steps is the loss of all tiles.
#include "optim/loss/flow_tiles.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "optim/loss/flow_loss.hpp"
#include "tests/support/device.hpp"
#include "tests/support/numbers.hpp"

namespace gflow {
namespace {

constexpr int kWidth = 70, kHeight = 35;  // 5 x 3 tiles, the last of each narrow
constexpr size_t kPixels = size_t(kWidth) * kHeight, kTiles = 15;

struct Asked {
  std::vector<float> target_flow = std::vector<float>(2 * kPixels, 0.f);
  std::vector<cl_uchar> confidence = std::vector<cl_uchar>(kPixels, 255);
  void set(int x, int y, float u, float v, cl_uchar trust = 255) {
    const size_t at = size_t(y) * kWidth + size_t(x);
    target_flow[at] = u;
    target_flow[kPixels + at] = v;
    confidence[at] = trust;
  }
};

std::vector<float> chosen(Queue& queue, const LowMotionRule& rule, const Asked& asked,
                          uint32_t seed) {
  FlowTiles tiles(queue, rule);
  const Buffer<float> target_flow(queue, asked.target_flow, "teacher");
  const Buffer<cl_uchar> confidence(queue, asked.confidence, "confidence");
  return tiles.choose(queue, seed, kWidth, kHeight, target_flow, confidence).read(queue);
}

class FlowTilesLanes : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(All, FlowTilesLanes, testing::Values(16, 8, 4, 1));

TEST_P(FlowTilesLanes, AsksOfEachAsOftenAsItShould) {
  Queue queue = test_queue(GetParam());
  Asked asked;
  asked.set(69, 0, 3, -4);             // tile 4, in its last column
  asked.set(17, 34, 0.3f, 0.4f, 128);  // tile 11, in its last row: 0.5 px, half confidence
  asked.set(40, 20, 0, 50, 0);         // tile 7: no confidence
  asked.set(0, 0, NOT_A_NUMBER, 0);    // tile 0: NaN
  asked.set(1, 0, 2e5f, 0);
  for (int y = 16; y < 32; ++y)
    for (int x = 16; x < 32; ++x) asked.set(x, y, 2, 2, 0);  // tile 6: no confidence anywhere
  const LowMotionRule rule{0.125f, 1};
  const int draws = 4000;
  std::vector<double> share(kTiles, 0.125);
  share[4] = 1, share[6] = 0, share[11] = 0.5 * 128 / 255;
  std::vector<int> count(kTiles, 0);
  std::vector<double> sum(kTiles, 0);
  for (int i = 0; i < draws; ++i) {
    const std::vector<float> weights = chosen(queue, rule, asked, uint32_t(i));
    ASSERT_EQ(weights.size(), kTiles);
    for (size_t t = 0; t < kTiles; ++t) {
      if (weights[t] == 0) continue;
      ++count[t];
      EXPECT_NEAR(double(weights[t]) * share[t], 1, 1e-6) << t;
      sum[t] += double(weights[t]);
      // Tiles with one probability are selected together, along with all tiles that move more.
      for (size_t other = 0; other < kTiles; ++other) {
        if (share[other] >= share[t]) {
          EXPECT_GT(weights[other], 0) << i << ": " << t << " without " << other;
        }
      }
    }
  }
  for (size_t t = 0; t < kTiles; ++t) {
    // For a probability p: standard deviation sqrt(p (1 - p) / draws), .0052 for 1/8; allows five.
    const double deviation = std::sqrt(share[t] * (1 - share[t]) / draws);
    EXPECT_NEAR(double(count[t]) / draws, share[t], 5 * deviation + 1e-12) << t;
    if (share[t] > 0) {
      EXPECT_NEAR(sum[t] / draws, 1, 5 * deviation / share[t] + 1e-6) << t;
    }
  }
}

TEST(FlowTiles, AllWidthsChooseTheSame) {
  std::vector<std::vector<float>> all;
  for (const int lanes : {16, 8, 4, 1}) {
    Queue queue = test_queue(lanes);
    Asked asked;
    asked.set(20, 20, 0.1f, 0.2f);
    all.push_back(chosen(queue, {0.3f, 0.5f}, asked, 7));
  }
  for (const auto& weights : all) EXPECT_EQ(weights, all[0]);
}

// The gradient of the loss over all tiles is the mean of the gradients over the selected tiles.
TEST(FlowTiles, TheLossIsRightInTheMean) {
  Queue queue = test_queue();
  Asked asked;
  for (int x = 0; x < kWidth; ++x) asked.set(x, 3, 0.01f * float(x), 0.1f);
  FlowTiles tiles(queue, {0.25f, 0.5f});
  FlowLoss loss(queue, 0.5f);
  const Buffer<float> target_flow(queue, asked.target_flow, "teacher");
  const Buffer<cl_uchar> confidence(queue, asked.confidence, "confidence");
  const Buffer<float> flow(queue, std::vector<float>(2 * kPixels, 0.2f), "flow");
  const Buffer<float> alpha(queue, std::vector<float>(kPixels, 0.9f), "alpha");
  Buffer<float> v_flow(queue, 2 * kPixels, "v_flow");
  const auto sum_of = [&](const Buffer<float>* weights) {
    loss.run(queue, 1, kWidth, kHeight, flow, alpha, target_flow, confidence, v_flow, weights);
    double sum = 0;
    for (const float v : v_flow.read(queue)) sum += double(v);
    return std::array<double, 3>{loss.value(queue).loss, sum, loss.value(queue).epe};
  };
  const std::array<double, 3> all = sum_of(nullptr);
  std::array<double, 3> mean{};
  const int draws = 4000;
  for (uint32_t i = 0; i < draws; ++i) {
    const auto one = sum_of(&tiles.choose(queue, i, kWidth, kHeight, target_flow, confidence));
    for (size_t k = 0; k < 3; ++k) mean[k] += one[k] / draws;
  }
  // All tiles at once with probability 1/4: a deviation of sqrt(3) = 1.7 per draw, .027 of the
  // mean; allows four.
  for (size_t k = 0; k < 3; ++k) EXPECT_NEAR(mean[k] / all[k], 1, 0.11) << k;
}

TEST(FlowTiles, RefusesWhatItCannotUse) {
  Queue queue = test_queue();
  for (const LowMotionRule rule :
       {LowMotionRule{0, 1}, LowMotionRule{1.5f, 1}, LowMotionRule{NOT_A_NUMBER, 1},
        LowMotionRule{1, 0}, LowMotionRule{1, NOT_A_NUMBER}})
    EXPECT_THROW(FlowTiles(queue, rule), Error);
  FlowTiles tiles(queue, {});
  const Buffer<float> target_flow(queue, 7, "teacher");
  const Buffer<cl_uchar> confidence(queue, 4, "confidence");
  EXPECT_THROW(tiles.choose(queue, 1, 2, 2, target_flow, confidence), Error);
}

}  // namespace
}  // namespace gflow
