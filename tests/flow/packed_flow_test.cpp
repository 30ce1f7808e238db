// SPDX-License-Identifier: Apache-2.0
#include "optim/flow/packed_flow.hpp"

#include <limits>
#include <random>

#include "runtime/base/worse.hpp"
#include "tests/support/moving_texture.hpp"

using namespace gflow;

namespace {

// Smooth in parts and noise up to `longest` elsewhere; every fifth pixel is unknown, every third
// one trusted.
TargetFlow any_flow(int width, int height, float longest) {
  TargetFlow target_flow{zero_flow(width, height), {}};
  std::mt19937 random(3);
  std::uniform_real_distribution<float> noise(-longest, longest);
  for (size_t i = 0; i < target_flow.flow.valid.size(); ++i) {
    target_flow.flow.valid[i] = i % 5 != 4;
    target_flow.confidence.push_back(i % 3 == 0 && target_flow.flow.valid[i] ? 255 : 0);
    if (!target_flow.flow.valid[i]) continue;
    target_flow.flow.uv[2 * i] = i % 7 ? noise(random) : 0.3f;
    target_flow.flow.uv[2 * i + 1] = i % 2 ? noise(random) : -longest;
  }
  return target_flow;
}

double largest_change(const TargetFlow& a, const TargetFlow& b) {
  double most = 0;
  for (size_t i = 0; i < a.flow.uv.size(); ++i)
    most = worse(most, std::fabs(a.flow.uv[i] - b.flow.uv[i]));
  return most;
}

}  // namespace

TEST(PackedFlow, IsRoundedByAtMostHalfItsUnit) {
  const std::pair<float, float> bounds[] = {
      {0.01f, 1 / 128.f}, {511, 1 / 128.f}, {600, 1 / 64.f}, {5000, 1 / 8.f}, {32000, 1 / 2.f}};
  for (const auto& [longest, bound] : bounds) {
    const TargetFlow flow = any_flow(37, 23, longest);
    const TargetFlow back = unpacked(packed(flow), "flow");
    EXPECT_LE(largest_change(flow, back), bound) << longest;
    // Of 1700 components some are near the middle between two representable values.
    if (longest > 1) {
      EXPECT_GT(largest_change(flow, back), 0.9f * bound) << longest;
    }
    EXPECT_EQ(back.flow.valid, flow.flow.valid);
    EXPECT_EQ(back.confidence, flow.confidence);
  }
}

TEST(PackedFlow, WhatIsRoundedAlreadyStaysAsItIs) {
  for (const auto& [width, height] : {std::pair(1, 1), {1, 9}, {9, 1}, {16, 8}, {37, 23}}) {
    const TargetFlow once = unpacked(packed(any_flow(width, height, 40)), "flow");
    const TargetFlow twice = unpacked(packed(once), "flow");
    EXPECT_EQ(once.flow.uv, twice.flow.uv);
    EXPECT_EQ(once.flow.valid, twice.flow.valid);
    EXPECT_EQ(once.confidence, twice.confidence);
  }
}

TEST(PackedFlow, WhatIsNoPlaceInAnyImageIsUnknown) {
  const float inf = std::numeric_limits<float>::infinity(), nan = std::nanf("");
  TargetFlow flow{uniform(5, 1, 1, 1), std::vector<uint8_t>(5, 255)};
  flow.flow.uv = {1, 1, nan, 1, 1, inf, -40000, 1, 1e20f, 1};
  const TargetFlow back = unpacked(packed(flow), "flow");
  EXPECT_EQ(back.flow.valid, (std::vector<uint8_t>{1, 0, 0, 0, 0}));
  EXPECT_EQ(back.confidence, (std::vector<uint8_t>{255, 0, 0, 0, 0}));
  EXPECT_EQ(back.flow.uv, (std::vector<float>{1, 1, 0, 0, 0, 0, 0, 0, 0, 0}));
}

TEST(PackedFlow, AnImageWithoutMotionTakesHardlyAnything) {
  const TargetFlow still{zero_flow(640, 480), std::vector<uint8_t>(640 * 480, 255)};
  EXPECT_LT(packed(still).size(), 10000u);  // of 2.8 MB
}

TEST(PackedFlow, EveryChangedByteIsNoticed) {
  const Bytes whole = packed(any_flow(6, 5, 3));
  for (size_t i = 0; i < whole.size(); ++i) {
    Bytes changed = whole;
    changed[i] ^= 1;
    expect_error([&] { unpacked(changed, "f.flow"); }, {"f.flow is damaged"});
    changed = whole;
    changed.resize(i);
    expect_error([&] { unpacked(changed, "f.flow"); }, {"f.flow is damaged"});
  }
}
