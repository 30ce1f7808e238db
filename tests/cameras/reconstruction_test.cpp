// SPDX-License-Identifier: Apache-2.0
// Poses and focal length from tracks of known points.
#include "optim/cameras/reconstruction.hpp"

#include <gtest/gtest.h>

#include "optim/cameras/upright.hpp"
#include "runtime/base/error.hpp"
#include "shared/random.h"
#include "tests/support/camera_path.hpp"

namespace gflow {
namespace {

constexpr int kFrames = 24, kWidth = 320, kHeight = 240;
constexpr double kFocal = 350;

double random_in(double low, double high, uint stream, uint i) {
  return low + (high - low) * random_uniform(11u, stream, i);
}

struct Film {
  std::vector<Eigen::Isometry3d> truth;
  std::vector<FeatureTrack> tracks;
  size_t moving = 0;  // the first tracks are of points that move
};

// Points in a box around the origin, each followed for at most ten frames, with noise [px]. The
// share `moving` of them travels through the world.
template <class PoseOf>
Film film_of(PoseOf&& pose_of, double noise, double moving, double k1 = 0) {
  Film film;
  for (int k = 0; k < kFrames; ++k) film.truth.push_back(pose_of(k));
  SharedLens lens;
  lens.focal = kFocal;
  lens.k1 = k1;
  lens.centre = {kWidth / 2., kHeight / 2.};
  const uint count = 600;
  film.moving = size_t(moving * count);
  for (uint i = 0; i < count; ++i) {
    const Eigen::Vector3d place(random_in(-2.5, 2.5, 0, i), random_in(-1.5, 3, 1, i),
                                random_in(0, 2, 2, i));
    const bool moves = i < film.moving;
    // Round in circles: straight and even motion would look like a point at rest elsewhere.
    const Eigen::Vector3d circle(random_in(.1, .3, 3, i), random_in(-.1, .1, 4, i),
                                 random_in(.1, .3, 5, i));
    const auto shift = [&](int k) -> Eigen::Vector3d {
      const Eigen::Vector3d turned(std::sin(.7 * k), std::cos(.7 * k), std::sin(.7 * k + 1));
      return moves ? turned.cwiseProduct(circle) : Eigen::Vector3d(0, 0, 0);
    };
    FeatureTrack track;
    track.first = std::max(0, int(random_in(-7, kFrames - 3, 6, i)));
    for (int k = track.first; k < std::min(kFrames, track.first + 10); ++k) {
      const Eigen::Vector3d in_camera = film.truth[size_t(k)] * (place + shift(k));
      const Eigen::Vector2d p = lens.project(in_camera);
      if (p.x() < 0 || p.y() < 0 || p.x() > kWidth || p.y() > kHeight) break;
      const uint at = 100 * i + uint(k);
      track.points.push_back(
          p + noise * Eigen::Vector2d(random_in(-1.7, 1.7, 7, at), random_in(-1.7, 1.7, 8, at)));
    }
    if (track.points.size() >= 3)
      film.tracks.push_back(track);
    else
      film.moving -= moves;
  }
  return film;
}

ReconstructionOptions options_of_film() {
  ReconstructionOptions options;
  options.frames = kFrames;
  options.width = kWidth;
  options.height = kHeight;
  return options;
}

std::vector<Eigen::Isometry3d> all_poses(const CameraPath& path) {
  std::vector<Eigen::Isometry3d> poses;
  for (const auto& pose : path.poses) poses.push_back(pose.value());
  return poses;
}

Eigen::Isometry3d on_arc(int k) { return pose_on_arc(k, kFrames); }

TEST(Reconstruction, WithoutNoiseItIsExact) {
  const Film film = film_of(on_arc, 0, 0);
  const CameraPath path = reconstruct(film.tracks, options_of_film());
  EXPECT_NEAR(path.lens.focal, kFocal, 1e-3 * kFocal);
  const PoseErrors errors = compare_poses(all_poses(path), film.truth);
  EXPECT_LT(errors.place, 1e-3);
  EXPECT_LT(errors.angle, 0.02);
}

// The bounds are those asked of real footage: 2 %, 1 % and 0.3 degrees.
TEST(Reconstruction, NoiseAndAQuarterOfMovingPointsDoLittle) {
  const Film film = film_of(on_arc, 0.3, 0.25);
  const CameraPath path = reconstruct(film.tracks, options_of_film());
  EXPECT_NEAR(path.lens.focal, kFocal, 0.02 * kFocal);
  const PoseErrors errors = compare_poses(all_poses(path), film.truth);
  EXPECT_LT(errors.place, 0.01);
  EXPECT_LT(errors.angle, 0.3);
  size_t moving_kept = 0, static_kept = 0;
  for (size_t i = 0; i < film.tracks.size(); ++i)
    (i < film.moving ? moving_kept : static_kept) += path.points[i].has_value();
  EXPECT_GT(static_kept, 0.9 * double(film.tracks.size() - film.moving));
  EXPECT_LT(moving_kept, 0.2 * double(film.moving));
}

TEST(Reconstruction, FindsRadialDistortion) {
  const Film film = film_of(on_arc, 0.1, 0, 0.15);
  ReconstructionOptions options = options_of_film();
  options.radial = true;
  const CameraPath path = reconstruct(film.tracks, options);
  EXPECT_NEAR(path.lens.k1, 0.15, 0.02);
  EXPECT_NEAR(path.lens.focal, kFocal, 0.02 * kFocal);
}

TEST(Reconstruction, AGivenFocalLengthStays) {
  ReconstructionOptions options = options_of_film();
  options.focal = 340;
  EXPECT_EQ(reconstruct(film_of(on_arc, 0.1, 0).tracks, options).lens.focal, 340);
}

TEST(Reconstruction, TheSameTracksGiveTheSameBits) {
  const Film film = film_of(on_arc, 0.3, 0.25);
  const CameraPath a = reconstruct(film.tracks, options_of_film()),
                   b = reconstruct(film.tracks, options_of_film());
  EXPECT_EQ(a.lens.focal, b.lens.focal);
  for (size_t k = 0; k < a.poses.size(); ++k) EXPECT_EQ(a.poses[k]->matrix(), b.poses[k]->matrix());
}

std::string error_of(const Film& film) {
  try {
    reconstruct(film.tracks, options_of_film());
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(Reconstruction, ACameraThatStandsStillIsAnError) {
  EXPECT_NE(
      error_of(film_of([](int) { return pose_on_arc(0, 2); }, 0.1, 0.2)).find("does not move"),
      std::string::npos);
}

TEST(Reconstruction, ACameraThatOnlyTurnsIsAnError) {
  const auto turning = [](int k) {
    Eigen::Isometry3d turn = Eigen::Isometry3d::Identity();
    turn.linear() = Eigen::AngleAxisd(1.0 * k * degree, Eigen::Vector3d::UnitY()).matrix();
    return turn * pose_on_arc(0, 2);
  };
  EXPECT_NE(error_of(film_of(turning, 0.2, 0)).find("turns but does not travel"),
            std::string::npos);
}

TEST(Reconstruction, FramesWithoutTracksAreNotPlaced) {
  Film film = film_of(on_arc, 0.1, 0);
  for (FeatureTrack& track : film.tracks)  // nothing is seen from frame 20 on
    track.points.resize(size_t(std::clamp(20 - track.first, 0, int(track.points.size()))));
  const CameraPath path = reconstruct(film.tracks, options_of_film());
  for (int k = 0; k < kFrames; ++k) EXPECT_EQ(path.poses[size_t(k)].has_value(), k < 20) << k;
}

TEST(Upright, ZPointsUpAndPointsSurroundTheOrigin) {
  const Film film = film_of(on_arc, 0, 0);
  CameraPath path = reconstruct(film.tracks, options_of_film());
  const CameraPath before = path;
  make_upright(film.tracks, path);
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const auto& pose : path.poses) up -= pose->rotation().row(1).transpose();
  EXPECT_LT((up.normalized() - Eigen::Vector3d::UnitZ()).norm(), 1e-6);
  std::vector<double> distances;
  for (size_t i = 0; i < film.tracks.size(); ++i) {
    if (!path.points[i]) continue;
    const int frame = film.tracks[i].first;  // it still projects where it did
    const Eigen::Vector2d was =
        before.lens.project(*before.poses[size_t(frame)] * *before.points[i]);
    EXPECT_LT((path.lens.project(*path.poses[size_t(frame)] * *path.points[i]) - was).norm(), 1e-6);
    distances.push_back(path.points[i]->norm());
  }
  std::sort(distances.begin(), distances.end());
  EXPECT_LT(distances[distances.size() / 2], 3);
}

}  // namespace
}  // namespace gflow
