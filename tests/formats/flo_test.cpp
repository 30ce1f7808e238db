// SPDX-License-Identifier: Apache-2.0
#include "optim/formats/flo.hpp"

#include <cmath>
#include <cstring>
#include <limits>

#include "tests/support/temporary_folder.hpp"

using namespace gflow;

namespace {

// A .flo file by the published format.
std::string flo(int32_t width, int32_t height, const std::vector<float>& uv) {
  std::string bytes = "PIEH" + std::string(8 + 4 * uv.size(), '\0');
  std::memcpy(&bytes[4], &width, 4);
  std::memcpy(&bytes[8], &height, 4);
  if (!uv.empty()) std::memcpy(&bytes[12], uv.data(), 4 * uv.size());
  return bytes;
}

std::vector<int> color_of(float u, float v, float longest) {
  FlowField flow = zero_flow(1, 1);
  flow.uv = {u, v};
  const FlowImage image = color_wheel(flow, longest);
  return {image.rgb.begin(), image.rgb.end()};
}

}  // namespace

TEST(Flo, ReadsTheMiddleburyFormat) {
  const TemporaryFolder folder;
  const FlowField flow = read_flo(folder.write("a.flo", flo(2, 1, {1.5f, -2, 0, 3})));
  EXPECT_EQ(flow.width, 2);
  EXPECT_EQ(flow.height, 1);
  EXPECT_EQ(flow.uv, (std::vector<float>{1.5f, -2, 0, 3}));
  EXPECT_EQ(flow.valid, (std::vector<uint8_t>{1, 1}));
}

TEST(Flo, HugeAndNonFiniteValuesAreUnknown) {
  const TemporaryFolder folder;
  const float nan = std::nanf(""), infinity = std::numeric_limits<float>::infinity();
  const FlowField flow =
      read_flo(folder.write("a.flo", flo(2, 2, {1e10f, 0, 0, nan, -infinity, 1, 4, 5})));
  EXPECT_EQ(flow.valid, (std::vector<uint8_t>{0, 0, 0, 1}));
  EXPECT_EQ(flow.uv, (std::vector<float>{0, 0, 0, 0, 0, 0, 4, 5}));
}

TEST(Flo, WhatIsWrittenIsReadAgainAlsoGzipped) {
  const TemporaryFolder folder;
  FlowField flow = zero_flow(3, 2);
  for (size_t i = 0; i < flow.uv.size(); ++i) flow.uv[i] = float(i) - 5.25f;
  flow.valid[4] = 0;
  for (const char* name : {"a.flo", "a.flo.gz"}) {
    write_flo(folder.file(name), flow);
    const FlowField back = read_flo(folder.file(name));
    FlowField expected = flow;
    expected.uv[8] = expected.uv[9] = 0;
    EXPECT_EQ(back.uv, expected.uv) << name;
    EXPECT_EQ(back.valid, expected.valid) << name;
  }
  EXPECT_EQ(contents(folder.file("a.flo.gz")).substr(0, 2), "\x1f\x8b");
}

TEST(Flo, RefusesWrongTagSizeAndLength) {
  const TemporaryFolder folder;
  const auto read = [&](const std::string& bytes) { read_flo(folder.write("a.flo", bytes)); };
  expect_error([&] { read("PIEX" + flo(1, 1, {0, 0}).substr(4)); }, {"a.flo", "not a .flo file"});
  expect_error([&] { read("PIEH"); }, {"a.flo"});
  expect_error([&] { read(flo(-1, 1, {0, 0})); }, {"-1x1"});
  expect_error([&] { read(flo(30000, 30000, {0, 0})); }, {"30000x30000", "20 bytes"});
  expect_error([&] { read(flo(2, 2, {0, 0})); }, {"20 bytes", "needs 44"});
}

TEST(Flo, ColorsFollowTheMiddleburyWheel) {
  EXPECT_EQ(color_of(0, 0, 1), (std::vector<int>{255, 255, 255}));  // no motion is white
  EXPECT_EQ(color_of(1, 0, 1), (std::vector<int>{255, 0, 0}));      // right: first hue, red
  // Down, a quarter turn, lies at hue 13.5 of 55, between RY 13 (221) and RY 14 (238): yellowish.
  EXPECT_EQ(color_of(0, 1, 1)[0], 255);
  EXPECT_NEAR(color_of(0, 1, 1)[1], 229, 2);
  EXPECT_EQ(color_of(0, 1, 1)[2], 0);
  // Half the length has half the saturation; beyond the maximum colours are darkened by 3/4.
  EXPECT_NEAR(color_of(.5f, 0, 1)[1], 127, 1);
  EXPECT_EQ(color_of(2, 0, 1), (std::vector<int>{191, 0, 0}));
}

TEST(Flo, UnknownFlowIsDrawnBlack) {
  FlowField flow = zero_flow(2, 1);
  flow.valid[0] = 0;
  const FlowImage image = color_wheel(flow);
  EXPECT_EQ(image.rgb, (std::vector<uint8_t>{0, 0, 0, 255, 255, 255}));
}

TEST(Flo, ReadsTheRealRubberWhalePairWhenItIsThere) {
  const std::string folder =
      std::string(GFLOW_SOURCE_DIR) + "/../shared/data/flow_middlebury_rubberwhale";
  size_t found = 0;
  if (std::filesystem::exists(folder))
    for (const auto& entry : std::filesystem::directory_iterator(folder)) {
      if (entry.path().extension() != ".flo") continue;
      ++found;
      const FlowField flow = read_flo(entry.path().string());
      EXPECT_EQ(flow.width, 584);
      EXPECT_EQ(flow.height, 388);
      double valid = 0;
      for (uint8_t v : flow.valid) valid += v;
      // Documented with the data: 98.4 % of the flow is known.
      EXPECT_NEAR(valid / double(flow.valid.size()), 0.984, 0.0005);
    }
  RecordProperty("files", int(found));
}
