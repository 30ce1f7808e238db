// SPDX-License-Identifier: Apache-2.0
// first_step, stride and max_steps, which apply to every layout.
#include "optim/scene/scene.hpp"
#include "tests/support/scene_files.hpp"

using namespace gflow;

namespace {

// Nine time steps of one camera with true flow, and of one test camera.
void make_steps(const TemporaryFolder& folder) {
  for (const char* view : {"input", "eval_1"})
    for (int k = 0; k < 9; ++k) {
      make_png(folder, fmt::format("{}/{}.png", view, k), 8, 8, 4);
      if (k < 8) write_flo(folder.file(fmt::format("flow/{}/{:04}.flo", view, k)), zero_flow(8, 8));
    }
}

Scene read(const TemporaryFolder& folder, int first, int stride, int most) {
  SceneOptions options;
  options.first_step = first;
  options.stride = stride;
  options.max_steps = most;
  return read_scene(folder.path(), options);
}

}  // namespace

TEST(Steps, ARangeBecomesAVideoOfItsOwn) {
  const TemporaryFolder folder;
  make_steps(folder);
  folder.write("tracks3d.npy", "not read here");
  const Scene scene = read(folder, 2, 1, 5);
  EXPECT_EQ(scene.steps, 5);
  ASSERT_EQ(scene.train.size(), 5u);
  ASSERT_EQ(scene.test.size(), 5u);
  EXPECT_EQ(std::filesystem::path(scene.train[0].path).filename(), "2.png");
  EXPECT_EQ(scene.train[4].step, 4);
  for (size_t k = 0; k < 5; ++k) {
    EXPECT_NEAR(scene.train[k].time, double(k) / 4, 1e-12);
    EXPECT_NEAR(scene.test[k].time, double(k) / 4, 1e-12);
  }
  EXPECT_NEAR(scene.train[3].flow_time, 1, 1e-12);
  EXPECT_EQ(scene.train[4].flow_path, "");  // it leads out of the range
  EXPECT_EQ(scene.fps, 24);
  EXPECT_EQ(scene.tracks_path, "");  // tracks cover all time steps
}

TEST(Steps, AStrideForgetsFlowThatLeadsToAStepLeftOut) {
  const TemporaryFolder folder;
  make_steps(folder);
  const Scene scene = read(folder, 1, 3, 0);  // 1, 4, 7
  ASSERT_EQ(scene.train.size(), 3u);
  EXPECT_EQ(std::filesystem::path(scene.train[2].path).filename(), "7.png");
  EXPECT_NEAR(scene.train[1].time, 0.5, 1e-12);
  EXPECT_EQ(scene.train[0].flow_path, "");
  EXPECT_NE(scene.test[0].flow_path, "");  // a view is evaluated by its own flow, wherever it leads
  EXPECT_NEAR(scene.test[0].flow_time, 1 / 6., 1e-12);
  EXPECT_EQ(scene.fps, 8);
  EXPECT_EQ(neighbour_pairs(scene).size(), 2u);
}

TEST(Steps, AllStepsAreLeftAsTheyAre) {
  const TemporaryFolder folder;
  make_steps(folder);
  const Scene all = read(folder, 0, 1, 0), more = read(folder, 0, 1, 20);
  EXPECT_EQ(all.train.size(), 9u);
  for (size_t k = 0; k < 9; ++k) EXPECT_EQ(all.train[k].time, more.train[k].time);
}

TEST(Steps, RangesThatAreNotThereAreRefused) {
  const TemporaryFolder folder;
  make_steps(folder);
  expect_error([&] { read(folder, 9, 1, 0); }, {"scene.first_step is 9", folder.path()});
  expect_error([&] { read(folder, -1, 1, 0); }, {"scene.first_step is -1"});
  expect_error([&] { read(folder, 0, 0, 0); }, {"scene.stride is 0"});
  expect_error([&] { read(folder, 0, 1, -1); }, {"scene.max_steps is -1"});
}
