// SPDX-License-Identifier: Apache-2.0
// Sums and counts against the host's, and their repeatability.
#include "runtime/primitives/reduce.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include "tests/support/device.hpp"

namespace gflow {
namespace {

std::vector<float> random_floats(size_t n) {
  std::mt19937 rng(1);
  std::uniform_real_distribution<float> uniform(0, 1);
  std::vector<float> data(n);
  for (float& x : data) x = uniform(rng);
  return data;
}

TEST(Reduce, SumsAnEmptyArrayToZero) {
  Queue queue = test_queue();
  EXPECT_EQ(Reduce(queue).sum(queue, Buffer<float>(queue, 0, "empty")), 0);
}

TEST(Reduce, SumsSmallIntegersExactlyAtAnyLength) {
  Queue queue = test_queue();
  Reduce reduce(queue);
  for (const size_t n : {1u, 15u, 16u, 17u, 255u, 256u, 257u, 10000u}) {
    std::vector<float> data(n);
    for (size_t i = 0; i < n; ++i) data[i] = float(i % 100);
    const double expected = std::accumulate(data.begin(), data.end(), 0.0);
    EXPECT_EQ(reduce.sum(queue, Buffer<float>(queue, data, "integers")), expected) << n;
  }
}

TEST(Reduce, SumsAMillionFloatsToTheirSumInDouble) {
  Queue queue = test_queue();
  const auto data = random_floats(1000003);
  const double expected = std::accumulate(data.begin(), data.end(), 0.0);
  // 20 sequential float additions of positive numbers: at most 20 x 6e-8 relative.
  EXPECT_NEAR(Reduce(queue).sum(queue, Buffer<float>(queue, data, "floats")), expected,
              1.2e-6 * expected);
}

TEST(Reduce, SumsARange) {
  Queue queue = test_queue();
  Buffer<float> values(queue, {1, 10, 100, 1000}, "values");
  EXPECT_EQ(Reduce(queue).sum(queue, values, 1, 2), 110);
  EXPECT_THROW(Reduce(queue).sum(queue, values, 3, 2), Error);
}

TEST(Reduce, GivesTheSameBitsEveryTimeAndInBothWorkGroupShapes) {
  const auto data = random_floats(100001);
  std::vector<double> sums;
  for (const int lanes : {0, 0, 1}) {
    Queue queue = test_queue(lanes);
    sums.push_back(Reduce(queue).sum(queue, Buffer<float>(queue, data, "floats")));
  }
  EXPECT_EQ(sums[0], sums[1]);
  EXPECT_EQ(sums[0], sums[2]);
}

TEST(Reduce, CountsWhatIsLarger) {
  Queue queue = test_queue();
  std::vector<cl_uint> data(1000, 0);
  for (size_t i = 0; i < 1000; i += 3) data[i] = cl_uint(i + 1);  // 334 of them
  Buffer<cl_uint> values(queue, data, "flags");
  EXPECT_EQ(Reduce(queue).count_nonzero(queue, values), 334u);
  EXPECT_EQ(Reduce(queue).count_above(queue, values, 1), 333u);
  EXPECT_EQ(Reduce(queue).count_above(queue, values, 997), 1u);
  EXPECT_EQ(Reduce(queue).count_above(queue, values, 1000), 0u);
}

}  // namespace
}  // namespace gflow
