// SPDX-License-Identifier: Apache-2.0
#include "optim/data/flow_store.hpp"

#include <cmath>

#include "data_readers/made_scene.hpp"
#include "optim/io/npy.hpp"

using namespace gflow;

namespace {

// A smooth texture moved by (dx, dy): the flow between two of them is known everywhere.
Image texture(int width, int height, double dx, double dy) {
  Image image{width, height, 3, {}};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < 3; ++c) {
        const double u = x - dx, v = y - dy;
        image.pixels.push_back(uint8_t(128 + 50 * std::sin(u * .35) * std::cos(v * .27) +
                                       40 * std::sin(u * .11 + v * .19)));
      }
  return image;
}

// Two steps of one camera, moved by (2, -1), with no true flow.
Scene make_scene(const TemporaryFolder& folder) {
  for (int k = 0; k < 3; ++k)
    write_png(folder.file(fmt::format("scene/{}.png", k)), texture(48, 40, 2 * k, -k));
  return read_scene(folder.path() + "/scene");
}

FlowField uniform(int width, int height, float u, float v) {
  FlowField flow = zero_flow(width, height);
  for (size_t i = 0; i < flow.valid.size(); ++i) flow.uv[2 * i] = u, flow.uv[2 * i + 1] = v;
  return flow;
}

}  // namespace

TEST(OpticalFlow, FindsAKnownTranslation) {
  const TeacherFlow teacher = estimate_teacher_flow(texture(64, 48, 0, 0), texture(64, 48, 2, -1));
  double error = 0;
  int n = 0;
  for (int y = 8; y < 40; ++y)
    for (int x = 8; x < 56; ++x, ++n) {
      const size_t i = size_t(y * 64 + x);
      error += std::hypot(teacher.flow.uv[2 * i] - 2, teacher.flow.uv[2 * i + 1] + 1);
      EXPECT_EQ(teacher.confidence[i], 255);
    }
  // DIS is accurate to a few hundredths of a pixel on smooth texture; .1 tells it from any error
  // of sign or axis.
  EXPECT_LT(error / n, 0.1);
}

TEST(OpticalFlow, WorksOnOnePixel) {
  const FlowField flow = estimate_flow(pattern(1, 1), pattern(1, 1));
  EXPECT_EQ(flow.width, 1);
  EXPECT_EQ(flow.uv.size(), 2u);
}

TEST(OpticalFlow, ConsistencyIsHalfAPixelOrFivePercent) {
  // Backward flow that misses by 0.4 px agrees, by 0.6 px not; at 20 px length 0.9 px still does.
  const auto middle = [](float u, float back) {
    return consistency(uniform(64, 1, u, 0), uniform(64, 1, back, 0))[32];
  };
  EXPECT_EQ(middle(2, -2.4f), 255);
  EXPECT_EQ(middle(2, -2.6f), 0);
  EXPECT_EQ(middle(20, -20.9f), 255);
  EXPECT_EQ(middle(20, -21.1f), 0);
  EXPECT_EQ(middle(40, -40), 0);  // leaves the picture
}

TEST(OpticalFlow, ResizingScalesTheVectors) {
  TeacherFlow teacher{uniform(8, 4, 4, 2), std::vector<uint8_t>(32, 255)};
  const TeacherFlow half = resized(teacher, 4, 2);
  EXPECT_EQ(half.flow.width, 4);
  EXPECT_EQ(half.flow.uv[0], 2);
  EXPECT_EQ(half.flow.uv[1], 1);
  EXPECT_EQ(half.confidence.size(), 8u);
}

TEST(FlowStore, ReadsAFolderOfTheUsers) {
  const TemporaryFolder folder;
  const Scene scene = make_scene(folder);
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
  expect_error([&] { read_true_flow(scene.train[1], 4, 1); }, {"input_0001", "without"});
}
