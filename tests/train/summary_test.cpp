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
  EXPECT_EQ(steps_of(5700, 20000),
            "steps: 20000 use each of the 5700 training images 3.5 times; --iterations 30000 would "
            "show more detail\n");
  EXPECT_EQ(steps_of(810, 20000), "");
  EXPECT_EQ(steps_of(5700, 20000, 10), "");
  EXPECT_EQ(steps_of(5700, 30000), "");
  EXPECT_EQ(steps_of(810, 500), "");  // fewer than the default: a draft
}

}  // namespace
}  // namespace gflow
