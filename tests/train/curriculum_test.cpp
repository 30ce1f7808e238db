// SPDX-License-Identifier: Apache-2.0
#include "optim/train/curriculum.hpp"

#include <gtest/gtest.h>

#include <set>

namespace gflow {
namespace {

TrainOptions some_config() {
  TrainOptions config;
  config.train.iterations = 1000;
  config.motion.hexplane.warmup = 100;
  config.motion.hexplane.curriculum = 0.5f;
  return config;
}

TEST(Curriculum, OtherModelsSeeTheWholeVideoFromTheFirstStep) {
  const Curriculum all_at_once = Curriculum::of(some_config(), false);
  EXPECT_FALSE(all_at_once.warming(0));
  EXPECT_EQ(all_at_once.share(0), 1);
  std::set<size_t> seen;
  for (size_t turn = 0; turn < 50; ++turn) seen.insert(all_at_once.view_at(50, 0, 3, turn));
  EXPECT_EQ(seen.size(), 50u);
}

TEST(Curriculum, WidensFromTheFirstViewsToAll) {
  const Curriculum curriculum = Curriculum::of(some_config(), true);
  EXPECT_TRUE(curriculum.warming(99));
  EXPECT_FALSE(curriculum.warming(100));
  EXPECT_EQ(curriculum.share(50), 0);
  EXPECT_DOUBLE_EQ(curriculum.share(350), 0.5);
  EXPECT_EQ(curriculum.share(600), 1);
  const size_t n = 60;
  size_t furthest = 0;
  for (const int step : {0, 100, 350, 599, 600, 999}) {
    std::set<size_t> seen;
    for (size_t turn = 0; turn < 240; ++turn) seen.insert(curriculum.view_at(n, step, 3, turn));
    EXPECT_GE(*seen.rbegin(), furthest);
    furthest = *seen.rbegin();
    EXPECT_EQ(seen.size(), furthest + 1) << step;  // all frames up to there
    EXPECT_EQ(furthest, step <= 100 ? 11u : step == 350 ? 35u : furthest) << step;
  }
  EXPECT_EQ(furthest, n - 1);
  EXPECT_LT(curriculum.view_at(5, 0, 3, 7), 5u);  // fewer views than the curriculum starts with
}

TEST(Curriculum, BeginsWhereMostImagesAre) {
  std::vector<Frame> frames;
  for (int k = 0; k < 5; ++k) {
    Frame frame;
    frame.time = k / 4.;
    frames.push_back(frame);
  }
  EXPECT_EQ(moment_to_begin(frames), 0.5);  // one camera
  Frame first;
  frames.push_back(first);
  EXPECT_EQ(moment_to_begin(frames), 0);  // another view of the first time step
  std::vector<Frame> even;
  for (int k = 0; k < 4; ++k)
    for (int camera = 0; camera < 2; ++camera) {
      Frame frame;
      frame.time = k / 3.;
      even.push_back(frame);
    }
  EXPECT_EQ(moment_to_begin(even), 0.5);
}

TEST(Curriculum, RatesFallOnceItIsDone) {
  const Curriculum curriculum = Curriculum::of(some_config(), true);
  EXPECT_EQ(curriculum.share_after(0), 0);
  EXPECT_EQ(curriculum.share_after(600), 0);
  EXPECT_DOUBLE_EQ(curriculum.share_after(800), 0.5);
  EXPECT_DOUBLE_EQ(curriculum.share_after(1000), 1);
  TrainOptions brief = some_config();
  brief.train.iterations = 200;
  EXPECT_FALSE(Curriculum::of(brief, true).warming(40));
  TrainOptions endless = some_config();  // the training ends before the curriculum
  endless.motion.hexplane.curriculum = 1;
  EXPECT_EQ(Curriculum::of(endless, true).share_after(999), 0);
}

TEST(Shuffled, GivesEveryItemOnceARound) {
  for (const size_t n : {size_t(1), size_t(2), size_t(7), size_t(20)})
    for (size_t round = 0; round < 5; ++round) {
      std::set<size_t> items;
      for (size_t i = 0; i < n; ++i) items.insert(shuffled(n, 11, round * n + i));
      EXPECT_EQ(items.size(), n);
      EXPECT_EQ(*items.rbegin(), n - 1);
    }
}

std::vector<size_t> round_of(size_t n, uint32_t seed, size_t round) {
  std::vector<size_t> order;
  for (size_t i = 0; i < n; ++i) order.push_back(shuffled(n, seed, round * n + i));
  return order;
}

TEST(Shuffled, IsAFunctionOfSeedAndIndex) {
  EXPECT_EQ(round_of(20, 5, 3), round_of(20, 5, 3));
  EXPECT_NE(round_of(20, 5, 3), round_of(20, 5, 4));
  EXPECT_NE(round_of(20, 5, 3), round_of(20, 6, 3));
}

// In 2000 rounds each of 5 items is first 400 times on average, with a deviation of 18; allows five
// deviations.
TEST(Shuffled, FavoursNoItem) {
  std::vector<int> first(5);
  for (size_t round = 0; round < 2000; ++round) ++first[shuffled(5, 1, 5 * round)];
  for (const int count : first) EXPECT_NEAR(count, 400, 90);
}

}  // namespace
}  // namespace gflow
