// SPDX-License-Identifier: Apache-2.0
// Adam against its formula in double, closed forms, bitwise unchanged unseen rows, and steps for
// some rows against steps for all. Parameter: lanes 0 (one work-item per row on CPUs) and 1 (one
// per scalar).
#include "runtime/primitives/adam.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <random>

#include "tests/support/compare.hpp"
#include "tests/support/device.hpp"

namespace gflow {
namespace {

std::vector<float> normal_floats(size_t n, unsigned seed) {
  std::mt19937 rng(seed);
  std::normal_distribution<float> normal;
  std::vector<float> data(n);
  for (float& x : data) x = normal(rng);
  return data;
}

bool same_bits(const std::vector<float>& a, const std::vector<float>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(float)) == 0;
}

// One group of rows on the device with its Adam.
struct AdamFixture {
  AdamFixture(int lanes, size_t rows, size_t width, const AdamConfig& config = {})
      : queue(test_queue(lanes)),
        rows(rows),
        adam(queue, config),
        group(queue, "values", rows, width),
        state(queue, rows) {
    state.seen.fill(queue, 1);
    group.values.fill(queue, 0);
  }
  void step(const std::vector<float>& grads, AdamRate rate) {
    group.grads.write(queue, grads);
    adam.refuse(queue, group, state, rows);
    adam.advance(queue, state, rows);
    adam.step(queue, group, state, rows, rate);
  }
  Queue queue;
  size_t rows;
  Adam adam;
  ParameterGroup group;
  RowState state;
};

class AdamTest : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Lanes, AdamTest, testing::Values(0, 1));

TEST_P(AdamTest, FirstStepIsTheLearningRateAgainstTheGradient) {
  AdamFixture f(GetParam(), 1, 3);
  f.step({5, -1e-3f, 0}, {0.5f, 1e-15f});
  // m c1 / sqrt(v c2^2) is sign(g) up to about 6 roundings of 6e-8.
  EXPECT_TRUE(
      all_close(f.group.values.read(f.queue), std::vector<double>{-.5, .5, 0}, {4e-7, 1e-30}));
}

TEST_P(AdamTest, ConstantGradientMovesByTheLearningRateEveryStep) {
  AdamFixture f(GetParam(), 1, 1);
  const int steps = 2000;
  for (int t = 0; t < steps; ++t) f.step({0.25f}, {0.125f, 1e-15f});
  // m and v, bias corrected, are exactly g and g^2 at every step: x = -steps lr. The error of each
  // step is at most some 100 roundings accumulated in v.
  EXPECT_NEAR(f.group.values.read(f.queue)[0], -250, 250 * 1e-5);
}

// Rows seen in step t, from 1: each row has its own rhythm, some from the first step on, one is
// never seen.
std::vector<cl_uint> seen_in(unsigned t, size_t rows) {
  std::vector<cl_uint> seen(rows);
  for (size_t row = 0; row + 1 < rows; ++row)
    seen[row] = row % 5 == 0 || (row * 7 + t * t) % (2 + row % 11) == 0;
  return seen;
}

TEST_P(AdamTest, FollowsTheReferenceInDoubleWithRowsSeenNowAndThen) {
  for (const float beta1 : {0.9f, 0.f}) {
    const size_t rows = 333, width = 3, n = rows * width;
    AdamConfig config;
    config.beta1 = beta1;
    AdamFixture f(GetParam(), rows, width, config);
    std::vector<AdamState> reference(n, {0, 0, 0});
    std::vector<unsigned> first(rows, 0), last(rows, 0);
    const AdamRate rate{0.01f, 1e-8f};
    for (unsigned t = 1; t <= 50; ++t) {
      const std::vector<float> grads = normal_floats(n, t);
      const std::vector<cl_uint> seen = seen_in(t, rows);
      f.state.seen.write(f.queue, seen);
      f.step(grads, rate);
      for (size_t row = 0; row < rows; ++row) {
        if (!seen[row]) continue;
        if (!first[row]) first[row] = last[row] = t;
        const unsigned missed = t == last[row] ? 0 : t - last[row] - 1;
        const AdamRow factors = adam_row(config, t - first[row] + 1, missed);
        for (size_t i = row * width; i < (row + 1) * width; ++i)
          reference[i] = adam_update(reference[i], grads[i],
                                     {config.beta1, config.beta2, rate.lr, rate.epsilon}, factors);
        last[row] = t;
      }
    }
    std::vector<double> expected;
    for (const AdamState& s : reference) expected.push_back(s.value);
    // 50 steps of .01, each accurate to about 20 roundings; m nearly cancels as well.
    EXPECT_TRUE(all_close(f.group.values.read(f.queue), expected, {1e-5, 1e-6})) << beta1;
  }
}

// With beta1 = 0, missed steps are made up for exactly. Steps for all rows start with a row's first
// gradient, as in training (Parameters::count_as_seen).
TEST_P(AdamTest, LeavingOutStepsWithoutAGradientChangesNothing) {
  const size_t rows = 100, width = 7, n = rows * width;
  AdamConfig config;
  config.beta1 = 0;
  AdamFixture some(GetParam(), rows, width, config), all(GetParam(), rows, width, config);
  const AdamRate rate{0.01f, 1e-8f};
  std::vector<cl_uint> begun(rows, 0);
  for (unsigned t = 1; t <= 300; ++t) {
    auto grads = normal_floats(n, t);
    const auto seen = seen_in(t, rows);
    some.state.seen.write(some.queue, seen);
    some.step(grads, rate);
    for (size_t row = 0; row < rows; ++row) {
      begun[row] |= seen[row];
      if (!seen[row])
        for (size_t k = 0; k < width; ++k) grads[row * width + k] = 0;
    }
    all.state.seen.write(all.queue, begun);
    all.step(grads, rate);
  }
  const auto found = some.group.values.read(some.queue),
             expected = all.group.values.read(all.queue);
  // A decay of k steps at once is accurate to one rounding, step by step to k: 300 steps of .01
  // with up to 3 each.
  EXPECT_TRUE(all_close(found, std::vector<double>(expected.begin(), expected.end()), {0, 3e-5}));
  EXPECT_EQ(found.back(), 0);  // the last row never had a gradient
  EXPECT_GT(std::fabs(found[0]), 1e-3);
}

TEST_P(AdamTest, WithoutMemoryOfTheMeanThereIsNoArrayForIt) {
  AdamConfig config;
  config.beta1 = 0;
  AdamFixture f(GetParam(), 40, 3, config);
  f.step(std::vector<float>(120, 2), {0.5f, 1e-15f});
  EXPECT_TRUE(
      all_close(f.group.values.read(f.queue), std::vector<double>(120, -.5), {4e-7, 1e-30}));
  EXPECT_FALSE(f.group.remembers());
}

TEST_P(AdamTest, ItIsThereFromTheFirstStepThatRemembersOn) {
  AdamFixture f(GetParam(), 40, 3);
  EXPECT_FALSE(f.group.remembers());
  f.step(std::vector<float>(120, 2), {0.5f, 1e-15f});
  const std::vector<float> expected(120, (1 - 0.9f) * 2);
  EXPECT_EQ(f.group.exp_avg.read(f.queue), expected);
  f.group.remember(f.queue);  // changes nothing
  EXPECT_EQ(f.group.exp_avg.read(f.queue), expected);
}

// Keys and planes: missed steps are ignored, so the second moment equals that of a row seen in
// every step.
TEST_P(AdamTest, WhatMakesUpForNothingGoesOnWhereItStopped) {
  AdamConfig config;
  config.makes_up = false;
  AdamFixture f(GetParam(), 2, 1, config);
  for (cl_uint t = 0; t < 30; ++t) {
    f.state.seen.write(f.queue, {1u, cl_uint(t % 3 == 0)});
    f.step({0.5f, 0.5f}, {0.125f, 1e-15f});
  }
  // A constant gradient moves a row by the learning rate in each of its own steps.
  const std::vector<double> expected{-30 * 0.125, -10 * 0.125};
  EXPECT_TRUE(all_close(f.group.values.read(f.queue), expected, {1e-5, 0}));
  EXPECT_EQ(f.state.steps.read(f.queue), (std::vector<cl_uint>{30, 10}));
}

// A row that is absent for longer than the table's length has forgotten its moments.
TEST_P(AdamTest, AfterALongAbsenceOnlyTheNewGradientCounts) {
  AdamFixture f(GetParam(), 1, 1);
  f.step({100}, {0, 1e-15f});
  f.state.now += 100000;
  f.step({1}, {1, 0});
  EXPECT_EQ(f.state.steps.read(f.queue)[0], 100002u);
  EXPECT_EQ(f.state.last.read(f.queue)[0], 100002u);
  // m = .1, v = .001, without correction.
  EXPECT_NEAR(f.group.values.read(f.queue)[0], -0.1 / std::sqrt(0.001), 1e-4);
}

// The textbook update, written out here; the shared formula is not used.
TEST_P(AdamTest, StaysWithinATenThousandthOverTenThousandSteps) {
  AdamFixture f(GetParam(), 1, 1);
  double x = 0, m = 0, v = 0, b1t = 1, b2t = 1;
  const double b1 = 0.9f, b2 = 0.999f, lr = 1e-3f;
  std::mt19937 rng(5);
  std::normal_distribution<float> normal(0.2f, 1);
  for (int t = 1; t <= 10000; ++t) {
    const float g = normal(rng);
    f.step({g}, {1e-3f, 1e-8f});
    m = b1 * m + (1 - b1) * g;
    v = b2 * v + (1 - b2) * double(g) * g;
    b1t *= b1;
    b2t *= b2;
    x -= lr * (m / (1 - b1t)) / (std::sqrt(v / (1 - b2t)) + double(1e-8f));
  }
  EXPECT_NEAR(f.group.values.read(f.queue)[0], x, 1e-4 * std::fabs(x));
}

TEST_P(AdamTest, UnseenRowsKeepEveryBit) {
  AdamFixture f(GetParam(), 4, 5);
  const auto values = normal_floats(20, 1), m = normal_floats(20, 2), v = normal_floats(20, 3);
  f.group.values.write(f.queue, values);
  f.group.remember(f.queue);
  f.group.exp_avg.write(f.queue, m);
  f.group.exp_avg_sq.write(f.queue, v);
  f.state.steps.write(f.queue, {9, 9, 9, 9});
  f.state.seen.fill(f.queue, 0);
  const float nan = std::numeric_limits<float>::quiet_NaN();
  f.step(std::vector<float>(20, nan), {1, 1e-8f});
  EXPECT_TRUE(same_bits(f.group.values.read(f.queue), values));
  EXPECT_TRUE(same_bits(f.group.exp_avg.read(f.queue), m));
  EXPECT_TRUE(same_bits(f.group.exp_avg_sq.read(f.queue), v));
  EXPECT_EQ(f.state.steps.read(f.queue), (std::vector<cl_uint>{9, 9, 9, 9}));
  EXPECT_EQ(f.state.rejected.read(f.queue), (std::vector<cl_uint>{0, 0, 0, 0}));
}

TEST_P(AdamTest, ZeroGradientWithZeroMomentsKeepsEveryBit) {
  AdamFixture f(GetParam(), 2, 3);
  const auto values = normal_floats(6, 1);
  f.group.values.write(f.queue, values);
  f.step(std::vector<float>(6, 0), {1, 1e-15f});
  EXPECT_TRUE(same_bits(f.group.values.read(f.queue), values));
}

TEST_P(AdamTest, RowWithABadGradientInOneGroupIsSkippedInAll) {
  AdamFixture f(GetParam(), 4, 2);
  ParameterGroup other(f.queue, "other", 4, 1);
  other.values.fill(f.queue, 0);
  other.grads.fill(f.queue, 1);
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = HUGE_VALF;
  f.group.grads.write(f.queue, {1, nan, 1, 1, -inf, 1, 1, 3e19f});  // (3e19)^2 is not a float
  f.adam.refuse(f.queue, f.group, f.state, 4);
  f.adam.refuse(f.queue, other, f.state, 4);
  f.adam.advance(f.queue, f.state, 4);
  f.adam.step(f.queue, f.group, f.state, 4, {1, 1e-15f});
  f.adam.step(f.queue, other, f.state, 4, {1, 1e-15f});
  EXPECT_EQ(f.state.rejected.read(f.queue), (std::vector<cl_uint>{2, 0, 2, 2}));
  EXPECT_EQ(f.state.steps.read(f.queue), (std::vector<cl_uint>{0, 1, 0, 0}));
  const auto values = other.values.read(f.queue);
  EXPECT_EQ(values[0], 0);
  EXPECT_NEAR(values[1], -1, 1e-6);  // the first step equals the learning rate
  EXPECT_EQ(values[2], 0);
  EXPECT_EQ(values[3], 0);
}

TEST_P(AdamTest, TreatsOnlyTheRowsInUse) {
  AdamFixture f(GetParam(), 3, 2);
  f.group.grads.fill(f.queue, 1);
  f.adam.advance(f.queue, f.state, 1);
  f.adam.step(f.queue, f.group, f.state, 1, {1, 1e-15f});
  const auto values = f.group.values.read(f.queue);
  EXPECT_NEAR(values[1], -1, 1e-6);  // the first step equals the learning rate
  EXPECT_EQ(values[2], 0);
  EXPECT_THROW(f.adam.step(f.queue, f.group, f.state, 4, {1, 1e-15f}), Error);
}

TEST_P(AdamTest, RowsInUseMayBeginAnywhere) {
  AdamFixture f(GetParam(), 5, 2);
  const RowRange middle{1, 3};
  f.state.rate_scale.write(f.queue, {2, 3, 4, 5, 6});
  f.group.grads.write(f.queue, {1, 1, 1, 1, 1, NAN, 1, 1, NAN, 1});
  f.adam.refuse(f.queue, f.group, f.state, middle);
  f.adam.advance(f.queue, f.state, middle);
  f.adam.step(f.queue, f.group, f.state, middle, {1, 1e-15f});
  const std::vector<double> expected{0, 0, -3, -3, 0, 0, -5, -5, 0, 0};  // row 2 is rejected
  EXPECT_TRUE(all_close(f.group.values.read(f.queue), expected, {4e-7, 1e-30}));
  EXPECT_EQ(f.state.rejected.read(f.queue), (std::vector<cl_uint>{0, 0, 2, 0, 0}));
}

TEST_P(AdamTest, CountsTheStepsInARowThatARowIsRefused) {
  AdamFixture f(GetParam(), 3, 1);
  const auto step = [&](const std::vector<float>& grads, const std::vector<cl_uint>& seen) {
    f.state.seen.write(f.queue, seen);
    f.group.grads.write(f.queue, grads);
    f.adam.refuse(f.queue, f.group, f.state, 3);
    f.adam.advance(f.queue, f.state, 3);
    return f.state.rejected.read(f.queue);
  };
  EXPECT_EQ(step({NAN, NAN, 1}, {1, 1, 1}), (std::vector<cl_uint>{2, 2, 0}));
  EXPECT_EQ(step({NAN, NAN, 1}, {1, 0, 1}), (std::vector<cl_uint>{3, 2, 0}));  // 1: no step of it
  EXPECT_EQ(step({NAN, 1, 1}, {1, 1, 1}), (std::vector<cl_uint>{4, 1, 0}));
  EXPECT_EQ(step({1, NAN, 1}, {1, 1, 1}), (std::vector<cl_uint>{1, 2, 0}));
}

TEST_P(AdamTest, RatesOfARowGrowWithItsPaceAndShrinkWithItsReach) {
  AdamFixture f(GetParam(), 2, 1);
  f.state.rate_scale.write(f.queue, {3, 3});
  f.state.rate_divisor.write(f.queue, {2, 4});
  f.group.grads.fill(f.queue, 1);
  f.adam.advance(f.queue, f.state, 2);
  f.adam.step(f.queue, f.group, f.state, 2, {1, 1e-15f, 2});
  const auto values = f.group.values.read(f.queue);
  EXPECT_NEAR(values[0], -3. / 4, 1e-6);  // rate_scale / rate_divisor^2
  EXPECT_NEAR(values[1], -3. / 16, 1e-6);
}

TEST_P(AdamTest, StepsBeyondTheTableUseNoCorrection) {
  AdamFixture f(GetParam(), 1, 1);
  f.state.steps.write(f.queue, {1000000});
  f.state.last.write(f.queue, {1000000});
  f.state.now = 1000000;
  f.step({1}, {1, 0});
  // m = .1, v = .001, uncorrected: the step is .1 / sqrt(.001)
  EXPECT_NEAR(f.group.values.read(f.queue)[0], -0.1 / std::sqrt(0.001), 1e-4);
}

TEST(AdamRow, IsOneInFloatAtTheEndOfTheTable) {
  const AdamRow row = adam_row(AdamConfig{}, 32767, 32767);
  EXPECT_EQ(float(row.correction1), 1);
  EXPECT_EQ(float(row.correction2), 1);
  EXPECT_LT(row.decay2, 1e-13);
  EXPECT_EQ(adam_row(AdamConfig{}, 1, 0).decay1, 1);
  EXPECT_EQ(adam_row(AdamConfig{}, 1, 2).decay1, double(.9f) * double(.9f));
}

TEST(Adam, RefusesABetaWhoseCorrectionOutlastsTheTable) {
  Queue queue = test_queue();
  AdamConfig config;
  config.beta2 = 0.9999f;
  EXPECT_THROW(Adam(queue, config), Error);
}

}  // namespace
}  // namespace gflow
