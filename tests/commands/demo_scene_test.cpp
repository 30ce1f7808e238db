// SPDX-License-Identifier: Apache-2.0
// The shipped scene is complete: everything that apps/demo/run needs can be read from it.
#include <gtest/gtest.h>

#include "optim/options/train_options.hpp"
#include "optim/scene/frame_store.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {
namespace {

const std::string demo = std::string(GFLOW_SOURCE_DIR) + "/apps/demo";

TEST(DemoScene, HasNineCamerasAndTwentyStepsOfWhichOneCameraIsForTheTest) {
  const Scene scene = read_scene(demo + "/scene");
  EXPECT_EQ(scene.cameras.size(), 9u);
  EXPECT_EQ(scene.steps, 20);
  EXPECT_EQ(scene.train.size(), 8u * 20);
  EXPECT_EQ(scene.test.size(), 20u);
  EXPECT_EQ(scene.points.size(), 6933u);  // "n_points" in the scene's metadata
}

TEST(DemoScene, TheTestCameraHasItsTrueFlowExceptAtTheLastStep) {
  const Scene scene = read_scene(demo + "/scene");
  for (const Frame& frame : scene.test) EXPECT_EQ(frame.flow_path.empty(), frame.step == 19);
}

TEST(DemoScene, VideoAndImagesHaveOneSize) {
  const Scene scene = read_scene(demo + "/scene");
  FrameStore store(scene);
  for (const Frame* frame : {&scene.train.front(), &scene.test.front()}) {
    const auto image = store.rgb(*frame);
    EXPECT_EQ(image->width, 256);
    EXPECT_EQ(image->height, 192);
  }
}

TEST(DemoScene, ItsSettingsAreKnown) {
  TrainOptions config;
  EXPECT_NO_THROW(apply_file(config, demo + "/config.toml"));
}

}  // namespace
}  // namespace gflow
