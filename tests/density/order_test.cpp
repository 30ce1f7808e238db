// SPDX-License-Identifier: Apache-2.0
// The order of rows in memory: a permutation that keeps the data of each Gaussian, places
// neighbours in time and space together, and depends on the parameters only.
#include "optim/density/order.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>

#include "optim/motion/spacetime.hpp"
#include "tests/support/device.hpp"

namespace gflow {
namespace {

constexpr size_t N_ORDER = 3000;

struct Cloud {
  std::vector<float> means, means_t, log_scales;
  Cloud() {
    std::mt19937 rng(3);
    const auto uniform = [&] { return float(rng() % 100000) / 100000; };
    for (size_t i = 0; i < N_ORDER; ++i) {
      for (int axis = 0; axis < 3; ++axis) means.push_back(4 * uniform() - 2);
      means_t.push_back(uniform());
      for (int axis = 0; axis < 3; ++axis) log_scales.push_back(-4);
      log_scales.push_back(i % 3 ? std::log(0.02f) : 1.f);
    }
  }
  std::vector<uint32_t> order() const { return order_of(means, means_t, log_scales, 1); }
};

TEST(RowOrder, PutsNeighboursInTimeAndSpaceTogether) {
  const Cloud cloud;
  const std::vector<uint32_t> order = cloud.order();
  EXPECT_EQ(std::set<uint32_t>(order.begin(), order.end()).size(), N_ORDER);
  double apart = 0, moments = 0;
  for (size_t j = 0; j < N_ORDER; ++j) {
    EXPECT_EQ(order[j] % 3 == 0, j < N_ORDER / 3) << j;  // Gaussians that last come first
    if (j == 0) continue;
    double square = 0;
    for (size_t axis = 0; axis < 3; ++axis)
      square +=
          std::pow(cloud.means[3 * order[j] + axis] - cloud.means[3 * order[j - 1] + axis], 2);
    apart += std::sqrt(square) / N_ORDER;
    if (j > N_ORDER / 3)
      moments += std::fabs(cloud.means_t[order[j]] - cloud.means_t[order[j - 1]]) / N_ORDER;
  }
  // In a cube with edges of 4, a grid of 1000 points has steps of 0.4, one of 125 (a sixteenth of
  // the short-lived ones) of 0.8. A Z curve through random points steps half as far again. In
  // random order they are 2.6 apart, and temporal means 1/3.
  EXPECT_LT(apart, 1.5 * (0.4 + 2 * 0.8) / 3);
  EXPECT_LT(moments, 0.02);
}

TEST(RowOrder, PutsWhatIsNotFiniteLastAndIsNotSpreadByWhatFlewAway) {
  Cloud cloud;
  const std::vector<uint32_t> before = cloud.order();
  cloud.means[3 * before[5]] = NAN;
  cloud.means_t[before[7]] = INFINITY;
  cloud.means[3 * before[9]] = 1e30f;
  const std::vector<uint32_t> order = cloud.order();
  EXPECT_EQ(std::set<uint32_t>(order.end() - 2, order.end()),
            (std::set<uint32_t>{before[5], before[7]}));
  size_t same = 0;  // of the successors of the others
  std::vector<uint32_t> next(N_ORDER);
  for (size_t j = 0; j + 1 < N_ORDER; ++j) next[before[j]] = before[j + 1];
  for (size_t j = 0; j + 1 < N_ORDER; ++j) same += next[order[j]] == order[j + 1];
  EXPECT_GT(same, N_ORDER * 9 / 10);
  EXPECT_TRUE(order_of({}, {}, {}, 1).empty());
}

TEST(RowOrder, KeepsWhatEachGaussianHasAndStaticOnesLast) {
  const Cloud cloud;
  Queue queue = test_queue();
  constexpr size_t moving = 2000;
  Parameters p(queue, N_ORDER, spacetime_groups(), {}, moving);
  p["means"].values.write(queue, cloud.means);
  p["means_t"].values.write(queue, cloud.means_t);
  p["log_scales"].values.write(queue, cloud.log_scales);
  std::vector<cl_uint> steps(N_ORDER);
  std::vector<float> velocities(3 * moving), opacities(N_ORDER), moments(3 * N_ORDER);
  for (size_t i = 0; i < N_ORDER; ++i) {
    steps[i] = cl_uint(i);
    opacities[i] = float(i) / N_ORDER;
    moments[3 * i] = float(i);
    if (i < moving) velocities[3 * i + 1] = float(i);
  }
  p.rows.steps.write(queue, steps);
  p["velocities"].values.write(queue, velocities);
  p["logit_opacities"].values.write(queue, opacities);
  p["means"].remember(queue);
  p["means"].exp_avg.write(queue, moments);

  RowOrder order(queue);
  const std::vector<cl_uint> source = order.sort(queue, p, 1).read(queue);
  EXPECT_EQ(p.moving, moving);
  const std::vector<cl_uint> new_steps = p.rows.steps.read(queue);
  const std::vector<float> new_means = p["means"].values.read(queue);
  const std::vector<float> new_velocities = p["velocities"].values.read(queue);
  const std::vector<float> new_opacities = p["logit_opacities"].values.read(queue);
  const std::vector<float> new_moments = p["means"].exp_avg.read(queue);
  size_t moved = 0;
  for (size_t j = 0; j < N_ORDER; ++j) {
    const size_t i = source[j];
    moved += i != j;
    EXPECT_EQ(i < moving, j < moving);
    EXPECT_EQ(new_steps[j], steps[i]);
    EXPECT_EQ(new_means[3 * j + 2], cloud.means[3 * i + 2]);
    EXPECT_EQ(new_opacities[j], opacities[i]);
    EXPECT_EQ(new_moments[3 * j], moments[3 * i]);
    if (j < moving) {
      EXPECT_EQ(new_velocities[3 * j + 1], velocities[3 * i + 1]);
    }
  }
  EXPECT_GT(moved, N_ORDER / 2);
  const std::vector<cl_uint> again = order.sort(queue, p, 1).read(queue);
  for (size_t j = 0; j < N_ORDER; ++j) EXPECT_EQ(again[j], j);  // already in order
}

}  // namespace
}  // namespace gflow
