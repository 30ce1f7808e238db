// SPDX-License-Identifier: Apache-2.0
// Cameras by COLMAP. A shell script takes the place of the program and answers with a model that
// the test has written.
#include "optim/cameras/colmap.hpp"

#include <gtest/gtest.h>

#include "optim/cameras/find_cameras.hpp"
#include "optim/scene/readers/colmap_model.hpp"
#include "runtime/base/interrupt.hpp"
#include "shared/random.h"
#include "tests/support/camera_path.hpp"
#include "tests/support/environment.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

constexpr int kPhotographs = 12, kLost = 5, kPhotoWidth = 64, kPhotoHeight = 48;
constexpr double kPhotoFocal = 70;

// The world of the model is turned, enlarged and shifted from that of pose_on_arc().
Eigen::Isometry3d photo_pose(int k) {
  const Eigen::AngleAxisd turn(2, Eigen::Vector3d(1, 2, 3).normalized());
  Eigen::Isometry3d pose = pose_on_arc(k, kPhotographs) * turn;
  pose.translation() = 3 * (pose.translation() + pose.linear() * Eigen::Vector3d(1, -2, 4));
  return pose;
}

Eigen::Vector3d photographed_point(uint i) {
  Eigen::Vector3d place;
  for (uint c = 0; c < 3; ++c) place[c] = 2 * double(random_uniform(5u, c, i)) - 1;
  const Eigen::Isometry3d there = photo_pose(0), here = pose_on_arc(0, kPhotographs);
  Eigen::Vector3d in_camera = 3 * (here * place);
  return there.inverse() * in_camera;
}

class ColmapProgram : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directory(path("tmp"));
    const Image grey{kPhotoWidth, kPhotoHeight, 3,
                     std::vector<uint8_t>(3 * kPhotoWidth * kPhotoHeight, 128)};
    for (int k = 0; k < kPhotographs; ++k)
      write_png(folder_.file(fmt::format("photos/{}.png", k)), grey);
    std::vector<int> all;
    for (int k = 0; k < kPhotographs; ++k)
      if (k != kLost) all.push_back(k);
    write_model("answer/0", {0, 1, 2}, "SIMPLE_PINHOLE 64 48 99 32 24");
    write_model("answer/1", all, fmt::format("SIMPLE_PINHOLE 64 48 {} 32 24", kPhotoFocal));
    be_colmap(fmt::format("cp -r {}/answer/* \"$output\"", folder_.path()));
  }

  void TearDown() override { EXPECT_TRUE(fs::is_empty(path("tmp"))); }

  // Every point is in every image, in its order: observation i of each is point i + 7.
  void write_model(const std::string& name, const std::vector<int>& frames,
                   const std::string& camera) {
    const uint points = 40;
    folder_.write(name + "/cameras.txt", "# cameras\n1 " + camera + "\n");
    std::string images, cloud;
    for (const int k : frames) {
      const Eigen::Isometry3d pose = photo_pose(k);
      const Eigen::Quaterniond q(pose.rotation());
      const Eigen::Vector3d t = pose.translation();
      images +=
          fmt::format("{} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} 1 {:05}.png\n",
                      100 - k, q.w(), q.x(), q.y(), q.z(), t.x(), t.y(), t.z(), k);
      for (uint i = 0; i < points; ++i) {
        const Eigen::Vector3d p = pose * photographed_point(i);
        images += fmt::format("{:.17g} {:.17g} {} ", 32 + kPhotoFocal * p.x() / p.z(),
                              24 + kPhotoFocal * p.y() / p.z(), i + 7);
      }
      images += "3 3 -1\n";  // a feature that is no point
    }
    for (uint i = 0; i < points; ++i) {
      const Eigen::Vector3d p = photographed_point(i);
      cloud +=
          fmt::format("{} {:.17g} {:.17g} {:.17g} 9 9 9 0.1 1 2\n", i + 7, p.x(), p.y(), p.z());
    }
    folder_.write(name + "/images.txt", images);
    folder_.write(name + "/points3D.txt", cloud);
  }

  // Puts a script named colmap first on PATH. `mapper`: what its mapper does.
  void be_colmap(const std::string& mapper, const std::string& help = "--SiftExtraction.use_gpu") {
    const std::string script =
        folder_.write("bin/colmap", fmt::format(R"(#!/bin/sh
here={}
case "$*" in *" -h") echo "{}"; exit;; esac
echo "$@" >> $here/calls
echo "this is $1"
command=$1
while [ $# -gt 1 ]; do
  case $1 in --image_path) ls "$2" > $here/images;; --input_path) input=$2;; --output_path) output=$2;; esac
  shift
done
case $command in
mapper) {};;
model_converter) cp "$input"/* "$output";;
esac
)",
                                                folder_.path(), help, mapper));
    fs::permissions(script, fs::perms::owner_all);
  }

  // Runs it; `err` and `out` receive what was printed.
  void find(FindCameras how = {}) {
    how.method = CameraMethod::colmap;
    how.quiet = true;
    SceneOptions options;
    options.path = path("photos");
    testing::internal::CaptureStdout();
    testing::internal::CaptureStderr();
    const auto captured = [&] {
      out = testing::internal::GetCapturedStdout();
      err = testing::internal::GetCapturedStderr();
    };
    try {
      find_cameras(load_video(options), options, how, path("made/scene"));
    } catch (...) {
      captured();
      throw;
    }
    captured();
  }

  std::string path(const std::string& name) const { return folder_.path() + "/" + name; }
  std::string calls() const { return contents(path("calls")); }
  size_t files_made() const {
    return fs::exists(path("made"))
               ? size_t(std::distance(fs::directory_iterator(path("made")), {}))
               : 0;
  }

  TemporaryFolder folder_;
  Environment temporary_{"TMPDIR", folder_.path() + "/tmp"};
  Environment path_{"PATH", folder_.path() + "/bin:" + std::getenv("PATH")};
  std::string out, err;
};

TEST_F(ColmapProgram, ItsLargestModelBecomesTheScene) {
  find();
  EXPECT_NE(out.find("11 of 12 placed"), std::string::npos) << out;
  EXPECT_NE(out.find("focal     70.0 px"), std::string::npos) << out;
  EXPECT_NE(out.find("40 seen 440 times, reprojection error 0.00 px"), std::string::npos) << out;
  EXPECT_NE(err.find("frames 5 could not be placed"), std::string::npos) << err;
  EXPECT_NE(err.find("the largest is used"), std::string::npos) << err;

  SceneOptions options;
  options.test_every = 0;
  const Scene scene = read_scene(path("made/scene"), options);
  EXPECT_TRUE(scene.estimated_cameras);
  EXPECT_EQ(scene.points.size(), 40u);
  ASSERT_EQ(scene.train.size(), size_t(kPhotographs - 1));
  std::vector<Eigen::Isometry3d> found, truth;
  Eigen::Vector3d up = Eigen::Vector3d::Zero();
  for (const Frame& frame : scene.train) {
    const Camera& camera = scene.cameras[size_t(frame.camera)];
    EXPECT_NEAR(camera.fx, kPhotoFocal, 1e-4);
    found.emplace_back(camera.viewmat);
    truth.push_back(pose_on_arc(int(std::lround(frame.time * (kPhotographs - 1))), kPhotographs));
    up -= camera.viewmat.block<1, 3>(1, 0).transpose();
  }
  const PoseErrors errors = compare_poses(found, truth);
  EXPECT_LT(errors.place, 1e-5);
  EXPECT_LT(errors.angle, 1e-3);
  EXPECT_LT((up.normalized() - Eigen::Vector3d::UnitZ()).norm(), 1e-5);

  EXPECT_EQ(read_colmap_model(path("made/scene/sparse/0")).images.size(), size_t(kPhotographs - 1));
  EXPECT_NE(contents(path("made/scene/colmap.log")).find("this is mapper"), std::string::npos);
  EXPECT_EQ(files_made(), 1u);
}

TEST_F(ColmapProgram, MatchesAllPhotographsWithEachOtherOnTheCpuByOneCamera) {
  find();
  for (const char* part :
       {"feature_extractor", "exhaustive_matcher", "--ImageReader.single_camera 1",
        "--ImageReader.camera_model SIMPLE_PINHOLE", "--SiftExtraction.use_gpu 0",
        "--SiftMatching.use_gpu 0", "--Mapper.ba_refine_focal_length 1"})
    EXPECT_NE(calls().find(part), std::string::npos) << part << " in " << calls();
  EXPECT_EQ(calls().find("camera_params"), std::string::npos) << calls();
  const std::string images = contents(path("images"));
  EXPECT_EQ(std::count(images.begin(), images.end(), '\n'), kPhotographs) << images;
  EXPECT_EQ(images.rfind("00000.png\n", 0), 0u) << images;
}

TEST_F(ColmapProgram, AGivenFieldOfViewStaysAndDistortionIsEstimated) {
  write_model("answer/1", {0, 1, 2, 3, 4, 6, 7}, "SIMPLE_RADIAL 64 48 70 32 24 0.125");
  FindCameras how;
  how.fovy = 2 * std::atan(24 / 70.) / degree;
  how.radial = true;
  find(how);
  for (const char* part :
       {"--ImageReader.camera_model SIMPLE_RADIAL", "--Mapper.ba_refine_focal_length 0",
        "--ImageReader.camera_params 70,32,24,0\n"})
    EXPECT_NE(calls().find(part), std::string::npos) << part << " in " << calls();
  EXPECT_NE(out.find("k1 0.1250"), std::string::npos) << out;
}

TEST_F(ColmapProgram, NewerVersionsCallTheOptionsOtherwise) {
  be_colmap(fmt::format("cp -r {}/answer/* \"$output\"", folder_.path()),
            "--FeatureExtraction.use_gpu");
  find();
  for (const char* part : {"--FeatureExtraction.use_gpu 0", "--FeatureMatching.use_gpu 0"})
    EXPECT_NE(calls().find(part), std::string::npos) << part << " in " << calls();
}

TEST_F(ColmapProgram, AStageThatFailsIsNamedWithItsLogAndNothingElseIsLeft) {
  be_colmap("echo out of luck; exit 3");
  expect_error([&] { find(); },
               {"photos", "colmap mapper exited with code 3", path("made/scene.colmap.log")});
  EXPECT_NE(contents(path("made/scene.colmap.log")).find("out of luck"), std::string::npos);
  EXPECT_EQ(files_made(), 1u);
}

TEST_F(ColmapProgram, SaysThatNoFrameCouldBePlaced) {
  for (const char* mapper : {"echo ERROR: failed to create sparse model; exit 1", ":"}) {
    be_colmap(mapper);
    expect_error([&] { find(); },
                 {"COLMAP could place none of the 12 frames", path("made/scene.colmap.log")});
    EXPECT_EQ(files_made(), 1u);
  }
}

TEST_F(ColmapProgram, AnInterruptionEndsItAndLeavesNothing) {
  be_colmap("kill -TERM $PPID; sleep 100");
  EXPECT_THROW(find(), Interrupted);
  EXPECT_EQ(interrupted_exit_code(), 143);
  EXPECT_EQ(files_made(), 0u);
}

TEST_F(ColmapProgram, WithoutTheProgramTheErrorSaysHowToGetIt) {
  const Environment nowhere("PATH", folder_.path() + "/photos");
  expect_error([&] { find(); }, {"colmap is not on PATH", "apt install colmap", "--method tracks"});
  EXPECT_EQ(files_made(), 0u);
}

class ColmapTracks : public testing::Test {
 protected:
  void write(const std::string& camera, const std::string& images) {
    folder_.write("cameras.txt", camera);
    folder_.write("images.txt", images);
    folder_.write("points3D.txt", "4 1 2 3 0 0 0 0.5 1 0\n8 4 5 6 0 0 0 0.5 1 0\n");
  }
  TrackedPath read() const { return read_colmap_tracks(folder_.path(), 6); }

  TemporaryFolder folder_;
};

TEST_F(ColmapTracks, SpanFromTheFirstFrameToTheLastAndLeaveOutTheOthers) {
  write("1 SIMPLE_PINHOLE 64 48 70 32 24\n",
        "9 1 0 0 0 1 2 3 1 00004.png\n5 6 4 7 7 4 1 1 8\n"  // point 4 twice
        "2 1 0 0 0 4 5 6 1 00001.png\n8 9 4 1 1 -1\n"
        "3 1 0 0 0 4 5 6 1 00002.png\n\n");
  const TrackedPath result = read();
  ASSERT_EQ(result.tracks.size(), 1u);  // one image alone shows point 8
  EXPECT_EQ(result.tracks[0].first, 1);
  EXPECT_EQ(result.path.used[0], std::vector<bool>({true, false, false, true}));
  EXPECT_EQ(result.tracks[0].at(1), Eigen::Vector2d(8, 9));
  EXPECT_EQ(result.tracks[0].at(4), Eigen::Vector2d(5, 6));
  EXPECT_EQ(*result.path.points[0], Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(result.path.poses[4]->translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_TRUE(result.path.poses[2]);
  EXPECT_FALSE(result.path.poses[3]);
}

TEST_F(ColmapTracks, OtherCamerasAndImagesAreRefused) {
  write("1 OPENCV 64 48 70 70 32 24 0 0 0 0\n", "");
  expect_error([&] { read(); }, {"cameras.txt", "OPENCV"});
  write("1 SIMPLE_PINHOLE 64 48 70 32 24\n", "9 1 0 0 0 1 2 3 1 00006.png\n\n");
  expect_error([&] { read(); }, {"images.txt", "00006.png"});
}

}  // namespace
}  // namespace gflow
