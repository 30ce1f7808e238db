// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/readers/reader_util.hpp"

#include <gtest/gtest.h>

namespace gflow {
namespace {

TEST(ReaderUtil, AFrameHasTheNearestStepOrTheEarlierOfTwo) {
  const std::vector<double> times = {0, 0.25, 0.5, 1};
  const std::vector<std::pair<double, int>> expected = {
      {0, 0}, {0.1, 0}, {0.125, 0}, {0.13, 1}, {0.25, 1}, {0.5, 2}, {0.75, 2}, {0.9, 3}, {1, 3}};
  std::vector<Frame> frames;
  for (const auto& [time, step] : expected) frames.emplace_back().time = time;
  for (const double outside : {-1., 2.}) frames.emplace_back().time = outside;
  set_steps(times, frames);
  for (size_t i = 0; i < expected.size(); ++i)
    EXPECT_EQ(frames[i].step, expected[i].second) << expected[i].first;
  EXPECT_EQ(frames[expected.size()].step, 0);
  EXPECT_EQ(frames.back().step, 3);
}

}  // namespace
}  // namespace gflow
