// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/held_back.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "runtime/base/error.hpp"

namespace gflow {
namespace {

Scene scene_of(int tracks, int times) {
  Scene scene;
  scene.name = "test";
  for (int track = 0; track < tracks; ++track)
    for (int k = 0; k < times; ++k) {
      Frame frame;
      frame.camera = frame.track = track;
      frame.time = times > 1 ? double(k) / (times - 1) : 0;
      frame.name = fmt::format("cam{:02}_{:04}", track, k);
      scene.train.push_back(frame);
    }
  return scene;
}

std::vector<std::string> names_of(const std::vector<Frame>& frames) {
  std::vector<std::string> names;
  for (const Frame& frame : frames) names.push_back(frame.name);
  return names;
}

TEST(HeldBack, IsEveryNthCameraWithAllItsImages) {
  Scene scene = scene_of(5, 2);
  hold_back(scene, 2);
  EXPECT_EQ(names_of(scene.val),
            (std::vector<std::string>{"cam01_0000", "cam01_0001", "cam03_0000", "cam03_0001"}));
  EXPECT_EQ(scene.train.size(), 6u);
}

TEST(HeldBack, IsEveryNthImageOfASingleCamera) {
  Scene scene = scene_of(1, 7);
  hold_back(scene, 3);
  EXPECT_EQ(names_of(scene.val), (std::vector<std::string>{"cam00_0002", "cam00_0005"}));
}

TEST(HeldBack, IsOneOfFew) {
  Scene scene = scene_of(4, 1);
  hold_back(scene, 8);
  EXPECT_EQ(names_of(scene.val), std::vector<std::string>{"cam02_0000"});
  Scene two = scene_of(2, 1);
  EXPECT_THROW(hold_back(two, 8), Error);
}

TEST(HeldBack, IsNothingByDefault) {
  Scene scene = scene_of(4, 1);
  hold_back(scene, 0);
  EXPECT_TRUE(scene.val.empty());
}

TEST(HeldBack, JoinsAScenesOwnValidationViewsAsOtherTracks) {
  Scene scene = scene_of(3, 1);
  scene.val = scene_of(2, 1).train;
  hold_back(scene, 2);
  ASSERT_EQ(scene.val.size(), 3u);
  EXPECT_EQ(scene.val.back().track, 1 + 2);
}

TEST(HeldBack, StepsAreThoseOfTheOthers) {
  Scene scene = scene_of(1, 4);
  scene.steps = 4;
  scene.tracks_path = "tracks3d.npy";
  hold_back(scene, 4);
  EXPECT_EQ(scene.steps, 3);
  EXPECT_TRUE(scene.tracks_path.empty());
  EXPECT_EQ(scene.val[0].step, 2);  // the nearest
}

}  // namespace
}  // namespace gflow
