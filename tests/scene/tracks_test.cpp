// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/tracks.hpp"

#include <Eigen/Geometry>
#include <cmath>

#include "optim/flow/flow_store.hpp"
#include "tests/support/scene_files.hpp"

using namespace gflow;

namespace {

// Camera-to-world in OpenGL axes at (x, 0, 4), rotated by `degrees` about the vertical axis;
// unrotated it looks along -z at the origin.
std::string pose_at(double degrees, double x = 0) {
  const double c = std::cos(degrees * M_PI / 180), s = std::sin(degrees * M_PI / 180);
  return fmt::format("[[{0},0,{1},{2}],[0,1,0,0],[{3},0,{0},4],[0,0,0,1]]", c, s, x, -s);
}

// A D-NeRF folder with one image of 20 x 16 pixels per time step, from these poses in turn. The
// field of view is 53 degrees, so the focal length equals the width.
void make_tracks(const TemporaryFolder& folder, const std::vector<std::string>& poses) {
  std::string frames;
  for (size_t i = 0; i < poses.size(); ++i) {
    make_png(folder, fmt::format("train/{}.png", i), 20, 16);
    frames += fmt::format(R"({}{{"file_path": "train/{}", "time": {}, "transform_matrix": {}}})",
                          i ? "," : "", i, double(i) / double(poses.size() - 1), poses[i]);
  }
  folder.write("transforms_train.json", fmt::format(R"({{"fl_x": 20, "frames": [{}]}})", frames));
}

Scene scene_from(const std::vector<std::string>& poses) {
  const TemporaryFolder folder;
  make_tracks(folder, poses);
  return read_scene(folder.path());
}

// The pairs as "from>to" in time steps.
std::string pairs_of(const Scene& scene) {
  std::string text;
  for (const FlowPair& pair : neighbour_pairs(scene)) {
    const int from = scene.train[size_t(pair.frame)].step;
    text += pair.next < 0 ? fmt::format("{}> ", from)
                          : fmt::format("{}>{} ", from, scene.train[size_t(pair.next)].step);
  }
  return text;
}

}  // namespace

TEST(Tracks, ACameraThatPansIsOne) {
  const Scene scene = scene_from({pose_at(-6), pose_at(-2), pose_at(2), pose_at(6)});
  EXPECT_EQ(scene.cameras.size(), 4u);
  EXPECT_EQ(pairs_of(scene), "0>1 1>2 2>3 ");
}

TEST(Tracks, ACameraThatWalksSidewaysIsOne) {
  // 0.25 of the way to the scene, at half the depth: 20 x 0.15 / 2 = 1.5 of 4 px.
  const Scene scene = scene_from({pose_at(0, 0), pose_at(0, 0.15), pose_at(0, 0.3)});
  EXPECT_EQ(pairs_of(scene), "0>1 1>2 ");
}

TEST(Tracks, ACameraThatTeleportsIsMany) {
  EXPECT_EQ(pairs_of(scene_from({pose_at(0), pose_at(40), pose_at(-40), pose_at(20)})), "");
  // Sideways: 20 x 1 / 2 = 10 px of 20.
  EXPECT_EQ(pairs_of(scene_from({pose_at(0, 0), pose_at(0, 1), pose_at(0, 2)})), "");
}

// Both look at the origin, which is in the middle of both images; points in front of it are not.
TEST(Tracks, TwoSidesOfOneObjectAreNotNear) {
  const Scene scene = scene_from({pose_at(-20, -1.456), pose_at(20, 1.456)});
  for (const Camera& camera : scene.cameras) EXPECT_NEAR(camera.project({0, 0, 0}).x(), 10, 0.01);
  EXPECT_FALSE(are_near(scene.cameras[0], scene.cameras[1], 4.26));
}

TEST(Tracks, ViewsThatMeetByChanceMakeNoVideo) {
  EXPECT_EQ(pairs_of(scene_from(
                {pose_at(0), pose_at(40), pose_at(41), pose_at(-40), pose_at(0), pose_at(20)})),
            "0>4 ");  // equal poses are one camera
}

TEST(Tracks, AnotherBeginsAtACut) {
  const Scene scene = scene_from(
      {pose_at(0), pose_at(2), pose_at(4), pose_at(60), pose_at(62), pose_at(64), pose_at(0)});
  EXPECT_EQ(pairs_of(scene), "0>1 1>2 3>4 4>5 ");
}

TEST(Tracks, ACameraMayComeBackToAPose) {
  EXPECT_EQ(pairs_of(scene_from({pose_at(0), pose_at(3), pose_at(0), pose_at(0)})), "0>1 1>2 2>3 ");
}

TEST(Tracks, ScenePointsSayHowFarAwayThingsAre) {
  const std::vector<std::string> poses{pose_at(0, 0), pose_at(0, 1), pose_at(0, 2)};
  const TemporaryFolder folder;
  make_tracks(folder, poses);
  EXPECT_EQ(pairs_of(read_scene(folder.path())), "");
  write_point_cloud(folder.file("points3D.ply"), {{0, 0, -96}, {9, 9, 9}});
  EXPECT_EQ(pairs_of(read_scene(folder.path())), "0>1 1>2 ");  // 20 x 1 / 50 = 0.4 px
}

// True flow is that of a static camera; estimated flow compares the images.
TEST(Tracks, TrueFlowOfAMovingCameraIsAPairOfItsOwn) {
  const TemporaryFolder folder;
  make_tracks(folder, {pose_at(-2), pose_at(0), pose_at(2)});
  write_flo(folder.file("flow_train/0.flo"), zero_flow(20, 16));
  write_flo(folder.file("flow_train/2.flo"), zero_flow(20, 16));
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(pairs_of(scene), "0>1 0> 1>2 2> ");
  const FrameStore frames(scene);
  const FlowStore flows = true_flows(scene, neighbour_pairs(scene), frames);
  EXPECT_FALSE(flows.has(0));
  EXPECT_TRUE(flows.has(1));
  EXPECT_FALSE(flows.has(2));
  EXPECT_TRUE(flows.has(3));
}

TEST(Tracks, FlowFilesMayLeadFromOneCameraToTheNextInTime) {
  const TemporaryFolder folder;
  make_tracks(folder, {pose_at(-40), pose_at(0), pose_at(40)});
  for (const char* name : {"0", "1"})
    write_flo(folder.file(std::string("flow/") + name + ".flo"), zero_flow(20, 16));
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(pairs_of(scene), "");  // cameras too far apart for an estimate
  const std::vector<FlowPair> pairs = pairs_in_time(scene);
  ASSERT_EQ(pairs.size(), 2u);
  EXPECT_EQ(pairs[1].frame, 1);
  EXPECT_EQ(pairs[1].next, 2);
  const FrameStore frames(scene);
  const FlowStore flows = flows_from_folder(scene, pairs, frames, folder.path() + "/flow");
  EXPECT_TRUE(flows.has(0) && flows.has(1));
  Scene twice = scene;
  twice.train[2].time = twice.train[1].time;
  EXPECT_THROW(pairs_in_time(twice), Error);
}

TEST(Tracks, FlowFilesOfTheUsersLeadFromImageToImage) {
  const TemporaryFolder folder;
  make_tracks(folder, {pose_at(-2), pose_at(0)});
  write_flo(folder.file("flow_train/0.flo"), zero_flow(20, 16));
  write_flo(folder.file("flow/train_0/0000.flo"), zero_flow(20, 16));
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(pairs_of(scene), "0>1 0> ");
  const FrameStore frames(scene);
  const FlowStore flows =
      flows_from_folder(scene, neighbour_pairs(scene), frames, folder.path() + "/flow");
  EXPECT_TRUE(flows.has(0));
  EXPECT_FALSE(flows.has(1));
}
