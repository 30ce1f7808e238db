// SPDX-License-Identifier: Apache-2.0
#include "optim/flow/point_tracks.hpp"

#include <limits>

#include "optim/formats/npz.hpp"
#include "tests/support/moving_texture.hpp"

using namespace gflow;

namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

// Three frames, four points.
const std::vector<float> kTracks = {1.5f, 2.5f, 10.2f, 4.9f, 10.4f, 4.4f, 7, 7,     //
                                    3.5f, 2.5f, 11,    5,    10.4f, 6,    8, kNan,  //
                                    5.5f, 1.5f, 12,    5,    10.4f, 8,    9, 9};

PointTracks tracks() { return {3, 4, kTracks, {1, 1, 1, 1, 1, 1, 1, 0, 0, 1, 1, 1}}; }

void write(const std::string& path, bool with_visibility, size_t images = 3) {
  Arrays arrays;
  std::vector<float> xy = kTracks, seen = {1, 1, 1, 1, 1, 1, 1, 1, 0.2f, 1, 1, 1};
  xy.resize(images * 8);
  arrays["tracks"] = {{images, 4, 2}, xy};
  if (with_visibility) arrays["visibility"] = {{3, 4}, seen};
  write_npz(path, arrays);
}

size_t known(const TargetFlow& flow) {
  return size_t(std::count(flow.confidence.begin(), flow.confidence.end(), 255));
}

}  // namespace

TEST(PointTracks, AreAFlowAtTheirPixels) {
  const TargetFlow flow = flow_of_points(tracks(), 0, 1, 48, 40);
  EXPECT_EQ(known(flow), 2u);  // two points share a pixel; the last one is hidden
  const size_t first = 2 * 48 + 1, shared = 4 * 48 + 10;
  EXPECT_EQ(flow.flow.uv[2 * first], 2);
  EXPECT_EQ(flow.flow.uv[2 * first + 1], 0);
  // The third point is nearer to (10.5, 4.5) than the second.
  EXPECT_EQ(flow.flow.uv[2 * shared], 0);
  EXPECT_NEAR(flow.flow.uv[2 * shared + 1], 1.6, 1e-6);
  EXPECT_EQ(flow.flow.valid[shared], 1);
  EXPECT_EQ(flow.flow.valid[0], 0);
  EXPECT_EQ(flow.emphasis, 16);                                  // 1920 pixels, two points
  EXPECT_EQ(flow_of_points(tracks(), 0, 1, 4, 4).emphasis, 16);  // one of 16 pixels
  EXPECT_EQ(known(flow_of_points(tracks(), 0, 2, 48, 40)), 2u);  // the first is hidden then
  const TargetFlow back = flow_of_points(tracks(), 2, 1, 48, 40);
  EXPECT_EQ(back.flow.uv[2 * (5 * 48 + 12)], -1);
}

TEST(PointTracks, ScaleWithTheImages) {
  const TargetFlow flow = flow_of_points(tracks(), 0, 1, 24, 20, 0.5f, 0.5f);
  EXPECT_EQ(flow.flow.uv[2 * (1 * 24 + 0)], 1);
}

TEST(PointTracks, AreReadFromAnArchive) {
  const TemporaryFolder folder;
  write(folder.file("all.npz"), false);
  const PointTracks all = read_point_tracks(folder.file("all.npz"));
  EXPECT_EQ(all.frames, 3u);
  EXPECT_EQ(all.points, 4u);
  EXPECT_EQ(all.seen, (std::vector<uint8_t>{1, 1, 1, 1, 1, 1, 1, 0, 1, 1, 1, 1}));
  write(folder.file("some.npz"), true);
  EXPECT_EQ(read_point_tracks(folder.file("some.npz")).seen[8], 0);
  write(folder.file("other.npz"), true, 2);
  expect_error([&] { read_point_tracks(folder.file("other.npz")); },
               {"other.npz", "'visibility' has shape (3, 4)", "(2, 4)"});
  write_npz(folder.file("flat.npz"), {{"tracks", {{3, 8}, kTracks}}});
  expect_error([&] { read_point_tracks(folder.file("flat.npz")); },
               {"flat.npz", "(3, 8)", "(frames, points, 2)"});
  write_npz(folder.file("none.npz"), {{"paths", {{3, 8}, kTracks}}});
  expect_error([&] { read_point_tracks(folder.file("none.npz")); },
               {"none.npz has no array 'tracks'", "(frames, points, 2)"});
}

TEST(PointTracks, BelongToTheCamerasOfAScene) {
  const TemporaryFolder folder;
  const Scene scene = textured_scene(folder);
  const FrameStore frames(scene);
  std::vector<FlowPair> pairs = neighbour_pairs(scene);
  for (const FlowPair& pair : distant_pairs(scene, 2)) pairs.push_back(pair);
  pairs.push_back({0, -1});
  write(folder.file("t/input.npz"), true);
  const FlowStore all(track_flows(scene, pairs, 0, frames, folder.path() + "/t"));
  EXPECT_EQ(all.size(), 4u);
  EXPECT_FALSE(all.has(3));
  FlowStore far(track_flows(scene, pairs, 2, frames, folder.path() + "/t/input.npz"));
  EXPECT_EQ(far.size(), 2u);
  // The second and the third point share a pixel; over two frames the first one is hidden.
  EXPECT_EQ(known(*far.get(0)), 2u);
  write(folder.file("t/input.npz"), false, 2);
  expect_error([&] { track_flows(scene, pairs, 0, frames, folder.path() + "/t"); },
               {"input.npz", "2 frames", "input has 3"});
  expect_error([&] { track_flows(scene, pairs, 0, frames, folder.path() + "/u"); },
               {"no tracks of camera input", "u/input.npz"});
  // Coordinates as fractions of the width, or in pixels of larger images.
  for (const auto& [factor, words] : {std::pair(0.01f, "except within the first pixel"),
                                      std::pair(1000.f, "images of camera input: ")}) {
    std::vector<float> xy = kTracks;
    for (float& value : xy) value *= factor;
    write_npz(folder.file("t/input.npz"), {{"tracks", {{3, 4, 2}, xy}}});
    expect_error([&] { track_flows(scene, pairs, 0, frames, folder.path() + "/t"); },
                 {"input.npz: no point is inside", words, "stored images, 48x40"});
  }
  // One camera of several may see no point, but not all of them.
  write_npz(folder.file("t/input.npz"), {{"tracks", {{3, 4, 2}, std::vector<float>(24, kNan)}}});
  expect_error([&] { track_flows(scene, pairs, 0, frames, folder.path() + "/t"); },
               {"no camera has a visible point"});
}
