// SPDX-License-Identifier: Apache-2.0
#include "optim/train/summary.hpp"

#include <gtest/gtest.h>

namespace gflow {
namespace {

std::string steps_of(size_t images, int iterations, int batch = 1) {
  Scene scene;
  scene.train.resize(images);
  ScheduleOptions schedule;
  schedule.iterations = iterations;
  schedule.batch = batch;
  return steps_in_words(scene, schedule);
}

TEST(StepsInWords, SuggestMoreWhereImagesAreUsedFewTimes) {
  EXPECT_EQ(steps_of(810, 10000),
            "steps: 10000 use each of the 810 training images 12 times; --iterations 20000 would "
            "show more detail\n");
  EXPECT_NE(steps_of(5700, 10000).find("--iterations 30000 "), std::string::npos);
  EXPECT_EQ(steps_of(810, 20000), "");
  EXPECT_EQ(steps_of(810, 10000, 2), "");
  EXPECT_EQ(steps_of(200, 10000), "");
  EXPECT_EQ(steps_of(5700, 30000), "");
  EXPECT_EQ(steps_of(810, 500), "");  // fewer than the default: a draft
}

}  // namespace
}  // namespace gflow
