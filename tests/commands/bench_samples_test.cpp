// SPDX-License-Identifier: Apache-2.0
// Statistics of `gflow bench` over its measurements, and the Pareto front.
#include "apps/bench/measure/front.hpp"
#include "apps/bench/measure/samples.hpp"
#include "gtest/gtest.h"

namespace gflow {
namespace {

// Differences of 3 % in time or error are ignored.
TEST(Bench, TheFrontHasWhoNobodyIsBetterThan) {
  using Costs = std::vector<bench::TimeAndErrors>;
  const auto front = [](const Costs& all) { return bench::pareto_front(all); };
  const bench::TimeAndErrors shipped{1, {1, 1, 1}};
  EXPECT_EQ(front({shipped}), (std::vector<bool>{true}));
  EXPECT_EQ(front({shipped, shipped}), (std::vector<bool>{true, true}));
  EXPECT_EQ(front({shipped, {.9, {1, 1, 1}}}), (std::vector<bool>{false, true})) << "faster";
  EXPECT_EQ(front({shipped, {1, {1, .8, 1}}}), (std::vector<bool>{false, true})) << "more exact";
  EXPECT_EQ(front({shipped, {.9, {1, 1, 1.2}}}), (std::vector<bool>{true, true})) << "a choice";
  EXPECT_EQ(front({shipped, {.98, {1, 1, 1}}}), (std::vector<bool>{true, true})) << "noise";
  EXPECT_EQ(front({shipped, {.9, {1.02, 1, 1}}}), (std::vector<bool>{false, true})) << "decimals";
  EXPECT_EQ(front({{1, {1, 0}}, {.9, {1, 0}}}), (std::vector<bool>{false, true})) << "no error";
  EXPECT_EQ(front({{2, {1, 1, 1}}, {1.5, {.5, 1, 1}}, {1, {1, .5, 1}}}),
            (std::vector<bool>{false, true, true}));
}

TEST(Bench, EveryWayComesFirstAsOftenAsEveryOther) {
  std::vector<std::vector<int>> before(5, std::vector<int>(5));
  for (int repeat = 0; repeat < 20; ++repeat) {
    const std::vector<size_t> order = bench::order_of(5, repeat);
    for (size_t i = 0; i < 5; ++i)
      for (size_t k = i + 1; k < 5; ++k) ++before[order[i]][order[k]];
  }
  for (size_t i = 0; i < 5; ++i)
    for (size_t k = 0; k < 5; ++k) EXPECT_EQ(before[i][k], i == k ? 0 : 10) << i << " " << k;
  EXPECT_NE(bench::order_of(5, 0), bench::order_of(5, 2));
  EXPECT_EQ(bench::order_of(5, 3), bench::order_of(5, 3));
}

// A slow machine slows both in one repeat: their ratio is 2 in each repeat.
TEST(Bench, ARatioIsThatOfEachRepeat) {
  const bench::Spread same = bench::ratio_of({2, 20, 4, 6}, {1, 10, 2, 3});
  EXPECT_EQ(same.low, 2);
  EXPECT_EQ(same.high, 2);
  const bench::Spread apart = bench::ratio_of({1, 2, 3}, {1, 1, 1});
  EXPECT_EQ(apart.low, 1.5);
  EXPECT_EQ(apart.median, 2);
  EXPECT_EQ(apart.high, 2.5);
}

// A machine that provided one core instead of two took twice as long for the same work. Whatever
// the idle time between kernels, the parts add up to the whole.
TEST(Bench, CpuTimeOfAStageDoesNotDependOnHowManyCoresWereFree) {
  const bench::Samples all{10, 20}, cpu{20, 20};
  EXPECT_EQ(bench::cpu_of({3, 6}, all, cpu), (bench::Samples{6, 6}));
  EXPECT_EQ(bench::cpu_of({7, 14}, all, cpu), (bench::Samples{14, 14}));
}

// Quartiles of the sums 1 + 9, 5 + 5 and 9 + 1; sums of quartiles would range from 6 to 14.
TEST(Bench, QuartilesOfAStageAreThoseOfItsKernelsTogether) {
  const bench::KernelSamples kernels{{"a", {1, 5, 9}}, {"b", {9, 5, 1}}, {"c", {1, 1, 1}}};
  const bench::Spread sum = bench::spread_of(bench::sum_of(kernels, {"a", "b", "none"}));
  EXPECT_EQ(sum.low, 10);
  EXPECT_EQ(sum.high, 10);
  EXPECT_EQ(bench::sum_of(kernels), (bench::Samples{11, 11, 11}));
  EXPECT_TRUE(bench::sum_of(kernels, {"none"}).empty());
}

}  // namespace
}  // namespace gflow
