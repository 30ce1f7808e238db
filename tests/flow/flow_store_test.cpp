// SPDX-License-Identifier: Apache-2.0
#include "optim/flow/flow_store.hpp"

#include <atomic>
#include <thread>

#include "optim/formats/npy.hpp"
#include "tests/support/moving_texture.hpp"

using namespace gflow;

TEST(FlowStore, ReadsAFolderOfTheUsers) {
  const TemporaryFolder folder;
  const Scene scene = textured_scene(folder);
  FrameStore frames(scene);
  const std::vector<FlowPair> pairs = neighbour_pairs(scene);
  const auto read = [&] { return flows_from_folder(scene, pairs, frames, folder.path() + "/f"); };
  write_flo(folder.file("f/input/0000.flo.gz"), uniform(96, 80, 6, 2));  // twice the size
  expect_error([&] { read(); }, {"step 1", "0001.flo", "0001.npy"});
  write_npy(folder.file("f/input/0001.npy"), {{40, 48, 2}, std::vector<float>(48 * 40 * 2, 1.5f)});
  FlowStore flows = read();
  EXPECT_EQ(flows.get(0)->flow.uv[0], 3);
  EXPECT_EQ(flows.get(1)->flow.uv[1], 1.5f);
  EXPECT_EQ(flows.get(1)->confidence[5], 255);
  write_npy(folder.file("f/input/0001.npy"), {{40, 48}, std::vector<float>(48 * 40)});
  FlowStore wrong = read();
  expect_error([&] { wrong.get(1); }, {"0001.npy", "(40, 48)", "(height, width, 2)"});
  write_flo(folder.file("f/input/0000.flo.gz"), uniform(50, 80, 6, 2));
  FlowStore unequal = read();
  expect_error([&] { unequal.get(0); }, {"50x80", "48x40"});
}

TEST(FlowStore, TrueFlowTrustsTheMask) {
  const TemporaryFolder folder;
  for (int k = 0; k < 2; ++k) make_png(folder, fmt::format("input/{}.png", k), 4, 1, 4);
  write_flo(folder.file("flow/input/0000.flo"), uniform(4, 1, 1, 0));
  write_png(folder.file("flow/input/0000_mask.png"), {4, 1, 1, {255, 128, 0, 255}});
  const Scene scene = read_scene(folder.path());
  FrameStore frames(scene);
  FlowStore flows = true_flows(scene, neighbour_pairs(scene), frames);
  EXPECT_EQ(flows.get(0)->confidence, (std::vector<uint8_t>{255, 0, 0, 255}));
  write_png(folder.file("flow/input/0000_mask.png"), {3, 1, 1, {255, 128, 0}});
  FlowStore unequal = true_flows(scene, neighbour_pairs(scene), frames);
  expect_error([&] { unequal.get(0); }, {"0000_mask.png", "3x1", "4x1"});
  expect_error([&] { read_true_flow(scene.train[1], 4, 1); }, {"input_0001", "no true flow"});
}

TEST(FlowStore, WhatIsPrefetchedIsLoadedOnceAndFailuresAreReportedByGet) {
  std::atomic<int> loads{0};
  std::vector<FlowStore::Loader> loaders(4);
  for (int k = 0; k < 3; ++k)
    loaders[size_t(k)] = [&loads, k]() -> TargetFlow {
      ++loads;
      if (k == 1) throw Error("no such flow");
      return {uniform(2, 2, float(k), 0), std::vector<uint8_t>(4, 255)};
    };
  FlowStoreOptions options;
  options.threads = 2;
  FlowStore flows(loaders, options);
  flows.prefetch({0, 1, 2, 3});
  while (loads < 3) std::this_thread::yield();
  EXPECT_EQ(flows.get(0)->flow.uv[0], 0);
  EXPECT_EQ(flows.get(2)->flow.uv[0], 2);
  EXPECT_EQ(loads, 3);
  expect_error([&] { flows.get(1); }, {"no such flow"});
  expect_error([&] { flows.get(3); }, {"no flow for frame pair 3"});
}
