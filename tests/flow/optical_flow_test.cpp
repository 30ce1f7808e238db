// SPDX-License-Identifier: Apache-2.0
#include "optim/flow/optical_flow.hpp"

#include "tests/support/moving_texture.hpp"

using namespace gflow;

TEST(OpticalFlow, FindsAKnownTranslation) {
  const TargetFlow target_flow =
      estimate_target_flows(texture(64, 48, 0, 0), texture(64, 48, 2, -1), CameraMotion::any).first;
  double error = 0;
  int n = 0;
  for (int y = 8; y < 40; ++y)
    for (int x = 8; x < 56; ++x, ++n) {
      const size_t i = size_t(y * 64 + x);
      error += std::hypot(target_flow.flow.uv[2 * i] - 2, target_flow.flow.uv[2 * i + 1] + 1);
      EXPECT_EQ(target_flow.confidence[i], 255);
    }
  // DIS is accurate to a few hundredths of a pixel on smooth texture; 0.1 detects any error of sign
  // or axis.
  EXPECT_LT(error / n, 0.1);
}

TEST(OpticalFlow, WorksOnOnePixel) {
  const FlowField flow =
      estimate_target_flows(pattern(1, 1), pattern(1, 1), CameraMotion::any).first.flow;
  EXPECT_EQ(flow.width, 1);
  EXPECT_EQ(flow.uv.size(), 2u);
}

TEST(OpticalFlow, ConsistencyIsHalfAPixelOrFivePercent) {
  // A backward flow that misses by 0.4 px is consistent, one by 0.6 px is not; at 20 px length 0.9
  // px still is.
  const auto middle = [](float u, float back) {
    return consistency(uniform(64, 1, u, 0), uniform(64, 1, back, 0))[32];
  };
  EXPECT_EQ(middle(2, -2.4f), 255);
  EXPECT_EQ(middle(2, -2.6f), 0);
  EXPECT_EQ(middle(20, -20.9f), 255);
  EXPECT_EQ(middle(20, -21.1f), 0);
  EXPECT_EQ(middle(40, -40), 0);  // leaves the image
}

TEST(OpticalFlow, ResizingScalesTheVectors) {
  TargetFlow target_flow{uniform(8, 4, 4, 2), std::vector<uint8_t>(32, 255)};
  const TargetFlow half = resized(target_flow, 4, 2);
  EXPECT_EQ(half.flow.width, 4);
  EXPECT_EQ(half.flow.uv[0], 2);
  EXPECT_EQ(half.flow.uv[1], 1);
  EXPECT_EQ(half.confidence.size(), 8u);
  const TargetFlow narrow = resized(target_flow, 4, 4);
  EXPECT_EQ(narrow.flow.uv[0], 2);
  EXPECT_EQ(narrow.flow.uv[1], 2);
}
