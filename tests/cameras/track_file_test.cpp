// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/track_file.hpp"

#include <gtest/gtest.h>

#include "runtime/files/atomic_file.hpp"
#include "tests/support/camera_path.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

constexpr int kTracked = 20;  // more than a tracker keeps images of

std::shared_ptr<const Image> tracked_image(int k) {
  static std::map<int, std::shared_ptr<const Image>> drawn;
  auto& image = drawn[k];
  if (!image)
    image =
        std::make_shared<const Image>(image_of_room(pose_on_arc(k, 2 * kTracked), 130, 160, 120));
  return image;
}

std::vector<FeatureTrack> finished(FeatureTracker& tracker, int next) {
  for (int k = next; k < kTracked; ++k) tracker.add(tracked_image(k));
  return tracker.finish();
}

void expect_equal(const std::vector<FeatureTrack>& a, const std::vector<FeatureTrack>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].first, b[i].first);
    EXPECT_EQ(a[i].points, b[i].points);
  }
}

TEST(TrackFile, TracksFromItContinueWithTheSameBits) {
  const TemporaryFolder folder;
  const std::string path = folder.file("tracks.npz");
  FeatureTracker whole(200);
  std::vector<FeatureTrack> expected = finished(whole, 0);
  ASSERT_GT(expected.size(), 200u);
  for (const int stop : {1, 5, kTracked - 1, kTracked}) {
    FeatureTracker tracker(200);
    for (int k = 0; k < stop; ++k) tracker.add(tracked_image(k));
    write_tracks(path, "a video", tracker.state());
    std::optional<TrackingState> state = read_tracks(path, "a video");
    ASSERT_TRUE(state);
    ASSERT_EQ(state->frames, stop);
    std::vector<std::shared_ptr<const Image>> recent;
    for (int k = std::max(0, stop - FeatureTracker::kKept); k < stop; ++k)
      recent.push_back(tracked_image(k));
    FeatureTracker continued(*std::move(state), recent, 200);
    expect_equal(finished(continued, stop), expected);
  }
}

TEST(TrackFile, OfAnotherVideoOrDamagedIsNotRead) {
  const TemporaryFolder folder;
  const std::string path = folder.file("tracks.npz");
  EXPECT_FALSE(read_tracks(path, "a video"));
  write_tracks(path, "a video", {});
  EXPECT_TRUE(read_tracks(path, "a video"));
  EXPECT_FALSE(read_tracks(path, "another"));
  Bytes bytes = read_file(path);
  bytes.resize(bytes.size() - 30);
  write_file_atomically(path, bytes);
  EXPECT_FALSE(read_tracks(path, "a video"));
}

}  // namespace
}  // namespace gflow
