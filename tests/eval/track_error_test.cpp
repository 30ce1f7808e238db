// SPDX-License-Identifier: Apache-2.0
// Points moved through space by Gaussians with known motion.
#include "optim/eval/track_error.hpp"

#include "optim/formats/flo.hpp"
#include "optim/formats/npy.hpp"
#include "tests/support/device.hpp"
#include "tests/support/small_scene.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

// A ball of Gaussians at the origin that moves by v per unit of time, and a static one far away.
HostModel moving_ball(const std::array<double, 3>& v, float turn, float life) {
  HostModel host;
  append_gaussian(host, {0, 0, 0}, 0.2f, {0.5f, 0.5f, 0.5f}, 0);
  append_gaussian(host, {0, 3, 0}, 0.2f, {0.5f, 0.5f, 0.5f}, 0);
  host.shape.sh_degree = 0;
  host.shape.duration = 2;
  set_static(host.shape, host.groups, host.count);
  for (size_t i = 0; i < 2; ++i) {
    host.groups["means_t"][i] = 0;
    host.groups["log_scales"][4 * i + 3] = std::log(life);
  }
  set_velocity(host.shape, host.groups, 0, v, 0.2, double(life));
  host.groups["turns"][3] = turn;  // about z
  return host;
}

TEST(TrackError, IsNoneOnTheTruePathsAndThePathsLengthWhereNothingMoves) {
  Queue queue = test_queue();
  const size_t steps = 5, points = 3;
  Tracks tracks{steps, points, {}, {}};
  for (size_t k = 0; k < steps; ++k) {
    const float t = 2 * float(k) / 4;
    for (const std::array<float, 3>& p :
         {std::array<float, 3>{0, 0, 0}, {.1f, .05f, 0}, {0, 3.1f, 0}}) {
      const bool moves = p[1] < 1;
      tracks.xyz.insert(tracks.xyz.end(), {p[0] + (moves ? .4f * t : 0), p[1], p[2]});
    }
  }
  Model right(queue, moving_ball({.4, 0, 0}, 0, 100));
  const TrackError none = track_error(queue, right, tracks);
  EXPECT_LT(none.mean, 1e-5);
  EXPECT_EQ(none.lost, 0);
  const double far = (0.2 + 0.4 + 0.6 + 0.8) / 4;  // mean over the later steps
  EXPECT_NEAR(none.still, far * 2 / 3, 1e-5);
  Model still(queue, moving_ball({0, 0, 0}, 0, 100));
  const TrackError all = track_error(queue, still, tracks);
  EXPECT_NEAR(all.mean, all.still, 1e-5);
  EXPECT_NEAR(all.median, far, 1e-5);
  EXPECT_NEAR(all.end, 0.8 * 2 / 3, 1e-5);
  EXPECT_LT(none.motion, 1e-5);
  EXPECT_NEAR(all.motion, 0.2 * 2 / 3, 1e-5);  // per step
  EXPECT_NEAR(all.motion_by_step[4], 0.2 * 2 / 3, 1e-5);
  ASSERT_EQ(all.by_step.size(), steps);
  for (size_t k = 0; k < steps; ++k) EXPECT_NEAR(all.by_step[k], 0.2 * double(k) * 2 / 3, 1e-5);
}

// A model that has the ball too far away by 1, but shows it at the same pixels.
TEST(TrackError, FromTheViewIsThatOfDepthAndMotion) {
  Queue queue = test_queue();
  Tracks tracks{5, 1, {}, {}};
  for (size_t k = 0; k < 5; ++k)
    for (const float x : {0.4f * 2 * float(k) / 4, 0.f, -1.f}) tracks.xyz.push_back(x);
  Camera camera;
  camera.width = camera.height = 64;
  camera.fx = camera.fy = 60, camera.cx = camera.cy = 32;
  camera.viewmat(2, 3) = 5;
  Model model(queue, moving_ball({.4, 0, 0}, 0, 100));
  EXPECT_EQ(track_error(queue, model, tracks).lost, 1);
  EXPECT_NEAR(track_error_from_view(queue, model, tracks, camera, 0.1f), 1, 1e-4);
  Model still(queue, moving_ball({0, 0, 0}, 0, 100));
  EXPECT_GT(track_error_from_view(queue, still, tracks, camera, 0.1f), 1.05);
}

TEST(TrackError, ATurningGaussianTakesItsPointsAround) {
  Queue queue = test_queue();
  Model model(queue, moving_ball({0, 0, 0}, 1, 100));  // quaternion (1, 0, 0, t): angle 2 atan t
  Tracks tracks{3, 1, {}, {}};
  for (const double t : {0.0, 1.0, 2.0}) {
    const double angle = 2 * std::atan(t);
    tracks.xyz.insert(tracks.xyz.end(),
                      {float(.15 * std::cos(angle)), float(.15 * std::sin(angle)), 0});
  }
  EXPECT_LT(track_error(queue, model, tracks).mean, 1e-5);
}

TEST(TrackError, APointThatNothingCarriesIsLostAndStays) {
  Queue queue = test_queue();
  Model model(queue, moving_ball({.4, 0, 0}, 0, .05f));  // invisible after the first step
  Tracks tracks{5, 1, {}, {}};
  for (int k = 0; k < 5; ++k) tracks.xyz.insert(tracks.xyz.end(), {.2f * float(k), 0, 0});
  const TrackError error = track_error(queue, model, tracks);
  EXPECT_NEAR(error.lost, 0.75, 1e-12);
  EXPECT_NEAR(error.end, 0.6, 1e-5);
}

// One camera at z = -2 whose flow is that of a wall at z = 0, one pixel to the right per step. The
// first point moves with the wall, the second moves otherwise behind it, the third leaves the
// image, the fourth joins the wall.
TEST(TrackError, WhatTrainingSawIsToldApart) {
  Queue queue = test_queue();
  const TemporaryFolder folder;
  Scene scene;
  Camera camera;
  camera.width = camera.height = 8;
  camera.fx = camera.fy = 8;
  camera.cx = camera.cy = 4;
  camera.viewmat(2, 3) = 2;
  scene.cameras = {camera};
  scene.steps = 3;
  FlowField wall{8, 8, std::vector<float>(128), std::vector<uint8_t>(64, 1)};
  for (size_t i = 0; i < 64; ++i) wall.uv[2 * i] = 1;
  write_flo(folder.file("wall.flo"), wall);
  for (int step = 0; step < 3; ++step) {
    Frame frame;
    frame.step = step;
    frame.time = step / 2.;
    frame.flow_time = (step + 1) / 2.;
    if (step < 2) frame.flow_path = folder.file("wall.flo");
    scene.train.push_back(frame);
  }
  const FrameStore frames(scene);
  Tracks tracks{3, 4, {}, {}};
  for (const float step : {0.f, 1.f, 2.f})
    tracks.xyz.insert(tracks.xyz.end(),
                      {.25f * step, 0, 0, .3f, .25f * step, .5f, step < 2 ? .25f * step : 9, .1f, 0,
                       step == 1 ? -.25f : 0, -.2f, 0});
  mark_seen(tracks, scene, frames);
  EXPECT_EQ(tracks.seen, (std::vector<uint8_t>{1, 0, 1, 0, 1, 0, 0, 1}));
  Model still(queue, moving_ball({0, 0, 0}, 0, 100));
  const TrackError error = track_error(queue, still, tracks);
  ASSERT_TRUE(error.seen);
  EXPECT_NEAR(error.seen->share, 4. / 8, 1e-12);
  EXPECT_NEAR(error.seen->mean, (.25 + .5 + .25) / 3, 1e-6);
  EXPECT_NEAR(error.seen->motion, .25, 1e-6);
  ASSERT_EQ(error.seen->by_step.size(), 3u);
  ASSERT_EQ(error.seen->motion_by_step.size(), 3u);
  EXPECT_TRUE(std::isnan(error.seen->motion_by_step[0]));
  for (const size_t step : {1u, 2u}) {
    EXPECT_NEAR(error.seen->by_step[step], .25 * double(step), 1e-6);
    EXPECT_NEAR(error.seen->motion_by_step[step], .25, 1e-6);
  }
  scene.train[1].flow_path.clear();  // a view without known flow
  mark_seen(tracks, scene, frames);
  EXPECT_TRUE(tracks.seen.empty());
  EXPECT_FALSE(track_error(queue, still, tracks).seen);
}

TEST(TrackError, FilesThatHoldNoTracksAreRefused) {
  const TemporaryFolder folder;
  write_npy(folder.file("a.npy"), Array{{4, 3}, std::vector<float>(12)});
  EXPECT_THROW(read_tracks(folder.file("a.npy")), Error);
  write_npy(folder.file("b.npy"), Array{{2, 1, 3}, std::vector<float>(6, NAN)});
  EXPECT_THROW(read_tracks(folder.file("b.npy")), Error);
  write_npy(folder.file("c.npy"), Array{{2, 1, 3}, std::vector<double>(6, .5)});
  EXPECT_EQ(read_tracks(folder.file("c.npy")).points, 1u);
}

}  // namespace
}  // namespace gflow
