// SPDX-License-Identifier: Apache-2.0
#include "optim/flow/chained_flow.hpp"

#include <cmath>

#include "tests/support/moving_texture.hpp"

using namespace gflow;

namespace {

std::shared_ptr<TargetFlow> trusted(FlowField flow) {
  auto target_flow = std::make_shared<TargetFlow>();
  target_flow->confidence.assign(flow.valid.size(), 255);
  target_flow->flow = std::move(flow);
  return target_flow;
}

struct Offset {
  double x, y;
};

// Displacement of pixel (x, y) when an image is rotated by `degrees` about pixel (31, 23).
Offset turn(double x, double y, double degrees) {
  const double a = degrees * M_PI / 180, dx = x - 31, dy = y - 23;
  return {std::cos(a) * dx - std::sin(a) * dy - dx, std::sin(a) * dx + std::cos(a) * dy - dy};
}

FlowField turning(double degrees) {
  FlowField flow = zero_flow(64, 48);
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 64; ++x) {
      const Offset f = turn(x, y, degrees);
      flow.uv[2 * size_t(y * 64 + x)] = float(f.x);
      flow.uv[2 * size_t(y * 64 + x) + 1] = float(f.y);
    }
  return flow;
}

// A bar at columns from..from+8 moves right by 2.5 px in front of a static background.
std::shared_ptr<TargetFlow> bar(double from) {
  FlowField flow = zero_flow(64, 4);
  std::vector<uint8_t> confidence(64 * 4, 255);
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 64; ++x) {
      const size_t i = size_t(y * 64 + x);
      const bool covered = x >= from && x < from + 8;
      const bool covered_next = x >= from + 2.5 && x < from + 10.5;
      if (covered) flow.uv[2 * i] = 2.5f;
      if (!covered && covered_next) confidence[i] = 0;  // covered by the bar in the next frame
    }
  auto target_flow = trusted(flow);
  target_flow->confidence = confidence;
  return target_flow;
}

}  // namespace

TEST(ChainedFlow, OfATurnIsTheWholeTurn) {
  const auto link = trusted(turning(5)), back = trusted(turning(-5));
  const TargetFlow chain = chained({link, link, link, link}, {back, back, back, back});
  int known = 0;
  for (int y = 0; y < 48; ++y)
    for (int x = 0; x < 64; ++x) {
      const size_t i = size_t(y * 64 + x);
      if (!chain.confidence[i]) continue;
      ++known;
      const Offset f = turn(x, y, 20);
      // The flow of a rotation is linear in the pixel, so interpolation adds no error beyond
      // rounding.
      EXPECT_NEAR(chain.flow.uv[2 * i], f.x, 1e-4);
      EXPECT_NEAR(chain.flow.uv[2 * i + 1], f.y, 1e-4);
    }
  EXPECT_GT(known, 64 * 48 / 2);  // the other pixels leave the image
  const size_t corner = 0, middle = 23 * 64 + 31;
  EXPECT_EQ(chain.confidence[corner], 0);
  EXPECT_EQ(chain.confidence[middle], 255);
}

TEST(ChainedFlow, IsThatOfOneSurfaceOrOfNone) {
  const TargetFlow chain = chained({bar(8), bar(10.5), bar(13), bar(15.5)});
  for (int x = 0; x < 64; ++x) {
    const size_t i = size_t(64 + x);  // in the second row
    const bool on_bar = x >= 8 && x < 16;
    const bool hidden = x >= 16 && x < 26;  // by the bar at some time
    // Only the two motions occur, whichever silhouettes the path crosses.
    EXPECT_EQ(chain.flow.uv[2 * i], on_bar ? 10 : 0) << x;
    EXPECT_EQ(chain.confidence[i], hidden ? 0 : 255) << x;
  }
}

TEST(ChainedFlow, IsNotTrustedWhereTheWayBackLeadsElsewhere) {
  const auto there = trusted(uniform(64, 1, 2, 0)), back = trusted(uniform(64, 1, -2, 0)),
             astray = trusted(uniform(64, 1, -2.5f, 0));
  EXPECT_EQ(chained({there, there}, {back, back}).confidence[20], 255);
  EXPECT_EQ(chained({there, there}, {astray, astray}).confidence[20], 0);
  EXPECT_EQ(chained({there, there}, {back, back}).confidence[62], 0);  // leaves the image
}

TEST(ChainedFlow, LeadsOverTheNeighboursThereAre) {
  const TemporaryFolder folder;
  const Scene scene = textured_scene(folder);  // three images
  std::vector<FlowPair> pairs = neighbour_pairs(scene);
  ASSERT_EQ(pairs.size(), 2u);
  const std::vector<FlowPair> apart = distant_pairs(scene, 2);
  ASSERT_EQ(apart.size(), 1u);
  EXPECT_EQ(apart[0].span, 2);
  EXPECT_TRUE(distant_pairs(scene, 3).empty());
  const auto links = [&](bool both) {
    std::vector<FlowStore::Loader> loaders(2);
    loaders[0] = [] { return *trusted(uniform(48, 40, 1, 2)); };
    if (both) loaders[1] = [] { return *trusted(uniform(48, 40, 3, -1)); };
    return std::make_shared<FlowStore>(loaders);
  };
  pairs.push_back(apart[0]);
  const auto whole = links(true);
  FlowStore flows = extended(whole, chained_flows(whole, pairs));
  ASSERT_EQ(flows.size(), 3u);
  EXPECT_EQ(flows.get(1)->flow.uv[0], 3);
  EXPECT_EQ(flows.get(2)->flow.uv[0], 4);
  EXPECT_EQ(flows.get(2)->flow.uv[1], 1);
  const auto broken = links(false);
  const FlowStore none = extended(broken, chained_flows(broken, pairs));
  EXPECT_TRUE(none.has(0));
  EXPECT_FALSE(none.has(1));
  EXPECT_FALSE(none.has(2));
}

TEST(ChainedFlow, IsKeptWhereItIsChecked) {
  const TemporaryFolder folder;
  const Scene scene = textured_scene(folder);
  const auto link = [](float u, float v) {
    return [=] { return *trusted(uniform(48, 40, u, v)); };
  };
  const FlowPair far = distant_pairs(scene, 2)[0];
  std::vector<FlowPair> there = neighbour_pairs(scene), both = there;
  for (const FlowPair& pair : reversed(there)) both.push_back(pair);
  there.push_back(far), both.push_back(far);
  const auto unchecked =
      std::make_shared<FlowStore>(std::vector<FlowStore::Loader>{link(1, 2), link(3, -1)});
  const auto checked = std::make_shared<FlowStore>(
      std::vector<FlowStore::Loader>{link(1, 2), link(3, -1), link(-1, -2), link(-3, 1)});
  int made = 0;
  FlowEstimation how;
  how.folder = folder.path() + "/kept";
  FrameStore frames(scene);
  const StoreFlow keep = stored_flows(scene, frames, how);
  const StoreFlow counting = [&](const FlowPair& pair, const MakeFlow& make) {
    return keep(pair, [&] {
      ++made;
      return make();
    });
  };
  const TargetFlow fresh = chained_flows(checked, both)[0]();
  for (int time = 0; time < 2; ++time) {
    const TargetFlow kept = chained_flows(checked, both, counting)[0]();
    EXPECT_EQ(kept.flow.uv, fresh.flow.uv) << time;  // whole pixels, so rounding changes nothing
    EXPECT_EQ(kept.confidence, fresh.confidence) << time;
  }
  EXPECT_EQ(made, 1);
  EXPECT_TRUE(
      std::filesystem::exists(how.folder + "/" + scene.train[0].name + "_over_2_chained.flow"));
  // Without the consistency check confidence is higher, so the stored flow must not be used.
  const TargetFlow other = chained_flows(unchecked, there, counting)[0]();
  EXPECT_NE(other.confidence, fresh.confidence);
  EXPECT_EQ(made, 1);
}
