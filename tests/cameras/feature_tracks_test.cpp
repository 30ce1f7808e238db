// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/feature_tracks.hpp"

#include <gtest/gtest.h>

#include "tests/support/camera_path.hpp"

namespace gflow {
namespace {

constexpr double kStepX = 2.3, kStepY = -1.1;  // [px] per frame

std::shared_ptr<const Image> moved_texture(double dx, double dy) {
  Image image{160, 120, 3, {}};
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const double level = texture_at(0.12 * (x - dx), 0.12 * (y - dy), 1);
      const auto value = uint8_t(std::clamp(128 + 90 * level, 0., 255.));
      image.pixels.insert(image.pixels.end(), {value, value, value});
    }
  return std::make_shared<const Image>(std::move(image));
}

TEST(FeatureTracks, FollowATextureWithoutDrift) {
  FeatureTracker tracker(100);
  for (int k = 0; k < 20; ++k) tracker.add(moved_texture(kStepX * k, kStepY * k));
  const std::vector<FeatureTrack> tracks = tracker.finish();
  EXPECT_GT(tracks.size(), 30u);
  size_t longest = 0;
  for (const FeatureTrack& track : tracks) {
    longest = std::max(longest, track.points.size());
    const double steps = double(track.points.size() - 1);
    const Eigen::Vector2d moved = track.points.back() - track.points.front();
    // Rounding of grey levels alone moves a corner by some hundredths of a pixel.
    EXPECT_LT((moved - steps * Eigen::Vector2d(kStepX, kStepY)).norm(), 0.15);
  }
  EXPECT_EQ(longest, 20u);
}

TEST(FeatureTracks, EndAtACutAndStartAgain) {
  FeatureTracker tracker(100);
  for (int k = 0; k < 10; ++k)
    tracker.add(moved_texture(kStepX * k + (k < 5 ? 0 : 1000), kStepY * k));
  size_t before = 0, after = 0, across = 0;
  for (const FeatureTrack& track : tracker.finish()) {
    before += track.end() <= 5;
    after += track.first >= 5;
    across += track.first < 5 && track.end() > 5;
  }
  EXPECT_GT(before, 30u);
  EXPECT_GT(after, 30u);
  EXPECT_LE(across, before / 10);
}

TEST(FeatureTracks, AnImageWithoutTextureHasNone) {
  FeatureTracker tracker;
  for (int k = 0; k < 4; ++k)
    tracker.add(
        std::make_shared<const Image>(Image{64, 48, 3, std::vector<uint8_t>(64 * 48 * 3, 128)}));
  EXPECT_TRUE(tracker.finish().empty());
}

}  // namespace
}  // namespace gflow
