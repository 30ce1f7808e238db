// SPDX-License-Identifier: Apache-2.0
#include <fmt/ranges.h>

#include <array>
#include <filesystem>
#include <regex>

#include "optim/scene/scene.hpp"
#include "tests/support/scene_files.hpp"

using namespace gflow;

namespace {

std::string frame(int k, const std::string& more = "") {
  return fmt::format(
      R"({{"file_path": "images/frame_{}.png", "transform_matrix":
         [[1,0,0,{}],[0,1,0,2],[0,0,1,3],[0,0,0,1]]{}}})",
      k, 10 * k, more);
}

std::string joined(const std::vector<std::string>& frames) {
  return fmt::format("{}", fmt::join(frames, ", "));
}

const char* const intrinsics = R"("fl_x": 20, "fl_y": 22, "cx": 9, "cy": 5, "w": 16, "h": 12)";

// transforms.json with these frames, and images/frame_0.png ... frame_11.png, 8x6.
void make_nerfstudio(const TemporaryFolder& folder, const std::string& frames,
                     const std::string& top = intrinsics) {
  for (int k = 0; k < 12; ++k) make_png(folder, fmt::format("images/frame_{}.png", k));
  folder.write("transforms.json", fmt::format(R"({{{}, "frames": [{}]}})", top, frames));
}

// A COLMAP model of frames 1, 2 and 3 (up to `last`) and a point (1, 2, 3), in another world:
// frame() has p = 2 Q x + (1, 0, 0), where Q turns by 90 degrees about z.
void make_colmap(const TemporaryFolder& folder, const std::string& sparse, int last = 3,
                 double error = 0) {
  folder.write(sparse + "/cameras.txt", "7 PINHOLE 16 12 20 22 9 5\n");
  folder.write(sparse + "/points3D.txt", "1 1 2 3 10 20 30 0.1\n");
  std::string images;
  for (int k = 1; k <= last; ++k)
    images += fmt::format("{} 0 1 -1 0 {} {} 1.5 7 frame_{}.jpg\n\n", k, 0.5 - 5 * k,
                          1 + (k == 2 ? error : 0), k);
  folder.write(sparse + "/images.txt", images);
}

std::vector<std::string> names_of(const std::vector<Frame>& frames) {
  std::vector<std::string> names;
  for (const Frame& one : frames) names.push_back(one.name);
  return names;
}

}  // namespace

TEST(Nerfstudio, EveryNthImageByNameIsForTheTest) {
  const TemporaryFolder folder;
  make_nerfstudio(folder, joined({frame(10), frame(2), frame(1), frame(3)}));
  SceneOptions options;
  options.test_every = 2;
  const Scene scene = read_scene(folder.path(), options);
  EXPECT_EQ(scene.layout, "nerfstudio");
  EXPECT_EQ(scene.steps, 1);
  EXPECT_EQ(names_of(scene.test), (std::vector<std::string>{"images_frame_1", "images_frame_3"}));
  // In the order of the file's cameras.
  EXPECT_EQ(names_of(scene.train), (std::vector<std::string>{"images_frame_10", "images_frame_2"}));
  const Camera& camera = scene.cameras[size_t(scene.train[0].camera)];
  EXPECT_EQ(camera.width, 8);  // half of the size in the file
  EXPECT_NEAR(camera.fx, 10, 1e-12);
  EXPECT_NEAR(camera.fy, 11, 1e-12);
  EXPECT_NEAR(camera.cx, 4.5, 1e-12);
  EXPECT_TRUE(camera.position().isApprox(Eigen::Vector3d(100, 2, 3)));
  EXPECT_EQ(camera.lens.kind, Lens::Kind::none);
  EXPECT_TRUE(neighbour_pairs(scene).empty());
}

// Images and flow are written to files named after them.
TEST(Nerfstudio, NamesOfDeepFoldersAreNoLongerThanThoseOfFiles) {
  const TemporaryFolder folder;
  const std::string deep = fmt::format("{0}/{0}/{0}/", std::string(90, 'd'));
  for (const int k : {1, 2}) make_png(folder, fmt::format("images/{}frame_{}.png", deep, k));
  make_nerfstudio(folder, std::regex_replace(joined({frame(1), frame(2)}), std::regex("frame_"),
                                             deep + "frame_"));
  SceneOptions options;
  options.test_every = 0;
  const std::vector<std::string> names = names_of(read_scene(folder.path(), options).train);
  ASSERT_EQ(names.size(), 2u);
  EXPECT_NE(names[0], names[1]);
  for (const std::string& name : names)
    EXPECT_NO_THROW(make_png(folder, fmt::format("test/{}.png", name))) << name;
}

TEST(Nerfstudio, TheFilesOwnListsWin) {
  const TemporaryFolder folder;
  make_nerfstudio(folder, joined({frame(1), frame(2), frame(3)}),
                  std::string(intrinsics) + R"(, "train_filenames": ["images/frame_1.png"],
            "test_filenames": ["./images/frame_2.png"], "val_filenames": ["images/frame_3.png"])");
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(names_of(scene.train), std::vector<std::string>{"images_frame_1"});
  EXPECT_EQ(names_of(scene.test), std::vector<std::string>{"images_frame_2"});
  EXPECT_EQ(names_of(scene.val), std::vector<std::string>{"images_frame_3"});
}

TEST(Nerfstudio, WhatIsInNoListIsForTraining) {
  const TemporaryFolder folder;
  make_nerfstudio(folder, joined({frame(1), frame(2), frame(3)}),
                  std::string(intrinsics) + R"(, "test_filenames": ["images/frame_2.png"])");
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(names_of(scene.train), (std::vector<std::string>{"images_frame_1", "images_frame_3"}));
  EXPECT_EQ(names_of(scene.test), (std::vector<std::string>{"images_frame_2"}));
}

TEST(Nerfstudio, TimesMakeStepsAndPointsAreWhereTheFileSays) {
  const TemporaryFolder folder;
  make_nerfstudio(folder,
                  joined({frame(1, R"(, "time": 0)"), frame(2, R"(, "time": 0.5)"),
                          frame(3, R"(, "time": 1)")}),
                  std::string(intrinsics) + R"(, "ply_file_path": "sparse_pc.ply")");
  write_point_cloud(folder.file("sparse_pc.ply"), {{1, 2, 3}, {4, 5, 6}});
  SceneOptions options;
  options.test_every = 0;
  const Scene scene = read_scene(folder.path(), options);
  EXPECT_EQ(scene.steps, 3);
  EXPECT_EQ(scene.train.size(), 3u);
  EXPECT_EQ(scene.points.xyz, (std::vector<double>{1, 2, 3}));
  EXPECT_TRUE(scene.notices.empty());
  write_point_cloud(folder.file("sparse_pc.ply"), {{1, 2, 3}, {}});
  const Scene grey = read_scene(folder.path(), options);
  ASSERT_EQ(grey.notices.size(), 1u);
  EXPECT_NE(grey.notices[0].find("have no colours"), std::string::npos) << grey.notices[0];
}

TEST(Nerfstudio, SparsePcIsUsedWithoutAnEntryUnlessOtherPointsAreGiven) {
  const TemporaryFolder folder;
  make_nerfstudio(folder, joined({frame(1, R"(, "time": 0)"), frame(2, R"(, "time": 1)")}));
  write_point_cloud(folder.file("other.ply"), {{1, 2, 3}, {4, 5, 6}});
  Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.points.size(), 0u);
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_NE(scene.notices[0].find("other.ply are not used"), std::string::npos);
  write_point_cloud(folder.file("sparse_pc.ply"), {{1, 2, 3, 4, 5, 6}, {1, 2, 3, 4, 5, 6}});
  scene = read_scene(folder.path());
  EXPECT_EQ(scene.points.size(), 2u);
  EXPECT_TRUE(scene.notices.empty());
  write_point_cloud(folder.file("points3D.ply"), {{7, 8, 9}, {4, 5, 6}});
  EXPECT_EQ(read_scene(folder.path()).points.size(), 1u);
}

// transforms.json may be turned, moved and scaled against the model it was made from.
TEST(Nerfstudio, PointsOfColmapAreMovedToTheWorldOfTheFrames) {
  for (const char* sparse : {"sparse/0", "sparse", "colmap/sparse/0", "colmap_sparse/0"}) {
    const TemporaryFolder folder;
    make_nerfstudio(folder, joined({frame(1), frame(2), frame(3), frame(4)}));
    make_colmap(folder, sparse);
    const Scene scene = read_scene(folder.path());
    EXPECT_EQ(scene.layout, "nerfstudio");
    EXPECT_TRUE(scene.notices.empty());
    ASSERT_EQ(scene.points.size(), 1u) << sparse;
    for (size_t i = 0; i < 3; ++i)  // rounding of sums of lengths up to 30
      EXPECT_NEAR(scene.points.xyz[i], (std::array<double, 3>{-3, 2, 6})[i], 1e-12);
  }
}

TEST(Nerfstudio, PointsOfColmapThatCannotBeMovedAreLeftOutAndTold) {
  const TemporaryFolder folder;
  make_nerfstudio(folder, joined({frame(1), frame(2), frame(3)}));
  const auto expect_notice = [&](const std::string& why) {
    const Scene scene = read_scene(folder.path());
    EXPECT_EQ(scene.points.size(), 0u);
    ASSERT_EQ(scene.notices.size(), 1u);
    EXPECT_NE(scene.notices[0].find("the points of COLMAP model " + folder.file("sparse/0") +
                                    " are not used: " + why),
              std::string::npos)
        << scene.notices[0];
  };
  make_colmap(folder, "sparse/0", 2);
  expect_notice("aligning them to the cameras of " + folder.file("transforms.json") +
                " needs three images that both name, but there are 2");
  make_colmap(folder, "sparse/0", 3, 4);
  expect_notice("its cameras do not agree with those of " + folder.file("transforms.json"));
  std::filesystem::remove(folder.file("sparse/0/cameras.txt"));
  expect_notice("it has no cameras");
  folder.write("sparse/0/points3D.txt", "");
  EXPECT_TRUE(read_scene(folder.path()).notices.empty());
}

TEST(Nerfstudio, TimesInFramesAreScaledAndTold) {
  const TemporaryFolder folder;
  make_nerfstudio(folder, joined({frame(1, R"(, "time": 0)"), frame(2, R"(, "time": 25)"),
                                  frame(3, R"(, "time": 100)")}));
  SceneOptions options;
  options.test_every = 0;
  const Scene scene = read_scene(folder.path(), options);
  EXPECT_EQ(scene.steps, 3);
  EXPECT_EQ(scene.train.at(1).time, 0.25);
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_NE(scene.notices[0].find("transforms.json are 0 to 100"), std::string::npos);
}

TEST(Nerfstudio, DistortionIsTheFramesOwnOrThatOfAll) {
  const TemporaryFolder folder;
  make_nerfstudio(
      folder, joined({frame(1), frame(2, R"(, "k1": -0.2)")}),
      std::string(intrinsics) +
          R"(, "camera_model": "OPENCV", "k1": -0.1, "k2": 0.02, "p1": 0.003, "p2": 0.004)");
  SceneOptions options;
  options.test_every = 0;
  Scene scene = read_scene(folder.path(), options);
  ASSERT_EQ(scene.cameras.size(), 2u);
  EXPECT_EQ(scene.cameras[0].lens.kind, Lens::Kind::radial);
  EXPECT_EQ(scene.cameras[0].lens.k, (std::array<double, 8>{-.1, .02, .003, .004}));
  EXPECT_EQ(scene.cameras[1].lens.k[0], -.2);
  EXPECT_EQ(scene.cameras[0].lens.fx, 10);  // at the size of the image
  make_nerfstudio(
      folder, frame(1),
      std::string(intrinsics) +
          R"(, "camera_model": "OPENCV_FISHEYE", "k1": 0.1, "k2": 0.02, "k3": 0.003, "k4": 0.004)");
  scene = read_scene(folder.path(), options);
  EXPECT_EQ(scene.cameras[0].lens.kind, Lens::Kind::fisheye);
  EXPECT_EQ(scene.cameras[0].lens.k, (std::array<double, 8>{.1, .02, .003, .004}));
}

// Of instant-ngp, which writes no camera_model.
TEST(Nerfstudio, AFlagMakesALensAFisheye) {
  const TemporaryFolder folder;
  SceneOptions options;
  options.test_every = 0;
  const auto cameras = [&](const std::string& frames, const std::string& top) {
    make_nerfstudio(folder, frames, std::string(intrinsics) + R"(, "k1": 0.1, "k4": 0.004)" + top);
    return read_scene(folder.path(), options).cameras;
  };
  const Lens flagged = cameras(frame(1), R"(, "is_fisheye": true)").at(0).lens;
  EXPECT_EQ(flagged.kind, Lens::Kind::fisheye);
  EXPECT_EQ(flagged.k, (std::array<double, 8>{.1, 0, 0, .004}));
  EXPECT_TRUE(flagged == cameras(frame(1), R"(, "camera_model": "OPENCV_FISHEYE")").at(0).lens);
  EXPECT_EQ(cameras(frame(1), R"(, "is_fisheye": false)").at(0).lens.kind, Lens::Kind::radial);
  const std::vector<Camera> own =
      cameras(joined({frame(1), frame(2, R"(, "is_fisheye": true)")}), "");
  EXPECT_EQ(own.at(0).lens.kind, Lens::Kind::radial);
  EXPECT_EQ(own.at(1).lens.kind, Lens::Kind::fisheye);
  expect_error([&] { cameras(frame(1), R"(, "is_fisheye": true, "camera_model": "OPENCV")"); },
               {"frame 0 of", "camera_model 'OPENCV', but 'is_fisheye' is true"});
  expect_error([&] { cameras(frame(1), R"(, "is_fisheye": 1)"); }, {"'is_fisheye'", "not true"});
}

TEST(Nerfstudio, MasksOfFramesAreIgnoredPixelsOrAlpha) {
  const TemporaryFolder folder;
  make_nerfstudio(folder, joined({frame(0), frame(1, R"(, "mask_path": "masks/1.png")")}));
  make_png(folder, "masks/1.png", 8, 6, 1);
  SceneOptions options;
  Scene scene = read_scene(folder.path(), options);
  EXPECT_FALSE(scene.has_alpha);
  EXPECT_EQ(scene.masks, Masks::ignore);
  EXPECT_EQ(scene.train[0].mask_path, folder.file("masks/1.png"));
  options.masks = Masks::alpha;
  EXPECT_TRUE(read_scene(folder.path(), options).has_alpha);
  options.masks = Masks::none;
  EXPECT_NE(read_scene(folder.path(), options).masks, Masks::ignore);
  EXPECT_FALSE(read_scene(folder.path(), options).has_alpha);
}

TEST(Nerfstudio, MasksThatTheFileDoesNotNameAreTold) {
  const TemporaryFolder folder;
  make_nerfstudio(folder, joined({frame(0), frame(1)}));
  make_png(folder, "masks/frame_1.png", 8, 6, 1);
  SceneOptions options;
  const Scene scene = read_scene(folder.path(), options);
  EXPECT_FALSE(scene.has_alpha);
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_EQ(scene.notices[0], "masks in " + folder.file("masks") +
                                  " are not used: no frame of transforms.json has a 'mask_path'");
  options.masks = Masks::none;
  EXPECT_TRUE(read_scene(folder.path(), options).notices.empty());
}

TEST(Nerfstudio, PathsOfWindowsHaveSlashes) {
  const TemporaryFolder folder;
  std::string windows = frame(1, R"(, "mask_path": "masks/1.png")");
  for (size_t at; (at = windows.find("s/")) != std::string::npos;) windows.replace(at, 2, R"(s\\)");
  make_nerfstudio(folder, windows);
  make_png(folder, "masks/1.png", 8, 6, 1);
  SceneOptions options;
  options.test_every = 0;
  const Scene scene = read_scene(folder.path(), options);
  EXPECT_EQ(scene.train.at(0).path, folder.file("images/frame_1.png"));
  EXPECT_EQ(scene.train.at(0).name, "images_frame_1");
  EXPECT_EQ(scene.train.at(0).mask_path, folder.file("masks/1.png"));
}

TEST(Nerfstudio, FilesThatContradictThemselvesAreRefused) {
  const TemporaryFolder folder;
  const auto with = [&](const std::string& frames, const std::string& top = intrinsics) {
    make_nerfstudio(folder, frames, top);
    SceneOptions options;
    options.test_every = 0;
    read_scene(folder.path(), options);
  };
  const std::string and_more = std::string(intrinsics) + ", ";
  expect_error([&] { with(frame(99)); },
               {"transforms.json", "frame_99.png", "without an image file"});
  expect_error([&] { with(""); }, {"transforms.json has no frames"});
  const std::string text(size_t{3} << 20, 'x');  // the parser stores it several times
  expect_error([&] { with(frame(1), and_more + "\"a\": \"" + text + "\""); },
               {"transforms.json", "a string of 3145728 bytes"});
  expect_error([&] { with(frame(1), and_more + "\"" + text); }, {"transforms.json", "a string of"});
  expect_error([&] { with(frame(1) + ", " + frame(2) + ", " + frame(1)); },
               {"frame 2 of", "frame_1.png, which is already that of frame 0"});
  expect_error([&] { with(frame(1, R"(, "mask_path": "m.png")")); },
               {"mask_path 'm.png'", "no file"});
  expect_error([&] { with(frame(1, R"(, "mask_path": 3)")); }, {"'mask_path'", "not a string"});
  expect_error([&] { with(frame(1), and_more + R"("camera_model": "EQUIRECTANGULAR")"); },
               {"'EQUIRECTANGULAR'", "OPENCV_FISHEYE"});
  expect_error([&] { with(frame(1), and_more + R"("k1": "x")"); }, {"'k1'", "not a finite number"});
  expect_error([&] { with(frame(1), and_more + R"("k6": 1e9)"); },
               {"frame 0 of", "coefficients 0, 0, 0, 0, 0, 0, 0, 1e+09"});
  expect_error([&] { with(frame(1), and_more + R"("ply_file_path": "../p.ply")"); },
               {"../p.ply", "relative path"});
  expect_error(
      [&] { with(frame(1), and_more + R"("ply_file_path": ")" + std::string(65536, 'p') + '"'); },
      {"ppp...'", "at most 1024 bytes"});
  expect_error([&] { with(frame(1), R"("fl_x": 9, "w": 8, "h": 8)"); }, {"8x6", "8x8"});
  expect_error([&] { with(frame(1), R"("fl_x": 9, "w": -8, "h": 8)"); }, {"size -8x8"});
  expect_error([&] { with(frame(1), R"("fl_x": 9, "w": 8.5, "h": 6)"); }, {"8.5x6", "integers"});
  expect_error([&] { with(frame(1), and_more + R"("train_filenames": 5)"); },
               {"'train_filenames'", "not a list"});
  expect_error([&] { with(frame(1), and_more + R"("train_filenames": ["images/frame_2.png"])"); },
               {"none of the 1 images in 'train_filenames'", "one of its 1 frames"});
  expect_error(
      [&] {
        with(joined({frame(1), frame(2)}),
             and_more + R"("train_filenames": ["images/frame_1.png", "images/frame_2.png"],
                           "test_filenames": ["images/frame_2.png"])");
      },
      {"images/frame_2.png in 'train_filenames' and in 'test_filenames'"});
  SceneOptions options;
  options.test_every = 1;
  with(frame(1));
  expect_error([&] { read_scene(folder.path(), options); },
               {"no training images", "all 1 frames", "scene.test_every = 1"});
  folder.write("transforms.json", R"({"frames": [{"file_)");
  expect_error([&] { read_scene(folder.path()); }, {"transforms.json", "not valid JSON"});
}

TEST(Nerfstudio, NumbersInTheNamesAreTimesIfAskedFor) {
  const TemporaryFolder folder;
  std::vector<std::string> frames;
  for (const int k : {0, 1, 2, 3, 5, 6, 7, 8, 10}) frames.push_back(frame(k));
  make_nerfstudio(folder, joined(frames));
  const Scene still = read_scene(folder.path());
  EXPECT_EQ(still.steps, 1);
  ASSERT_EQ(still.notices.size(), 1u);
  EXPECT_NE(still.notices[0].find("--set scene.times=order"), std::string::npos);
  SceneOptions options;
  options.times = Times::order;
  options.test_every = 4;
  const Scene scene = read_scene(folder.path(), options);
  EXPECT_TRUE(scene.notices.empty());
  EXPECT_EQ(scene.steps, 6);
  ASSERT_EQ(scene.train.size(), 6u);
  EXPECT_NEAR(scene.train[0].time, 0.1, 1e-12);
  EXPECT_NEAR(scene.train[3].time, 0.6, 1e-12);
  EXPECT_NEAR(scene.test[2].time, 1, 1e-12);
  EXPECT_EQ(scene.train[0].track, scene.train[5].track);  // one camera
  EXPECT_EQ(neighbour_pairs(scene).size(), 5u);
}

TEST(Nerfstudio, FramesWithoutAnImageOrPoseAreLeftOutAndTold) {
  const TemporaryFolder folder;
  std::string nowhere = frame(3);
  nowhere.replace(nowhere.find("[[1,"), 4, "[[-Infinity,");
  make_nerfstudio(folder, joined({frame(1), frame(2), nowhere, frame(4), frame(99)}));
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.train.size() + scene.test.size(), 3u);
  ASSERT_EQ(scene.notices.size(), 2u);
  EXPECT_NE(scene.notices[0].find("1 of 5 frames without an image file (the first is "
                                  "'images/frame_99.png'); they are left out"),
            std::string::npos);
  EXPECT_NE(scene.notices[1].find("1 of 5 frames whose pose has NaN or Inf"), std::string::npos);
}

TEST(Nerfstudio, PathsOfAnotherMachineEndInsideTheFolder) {
  const TemporaryFolder folder;
  std::string text = joined({frame(1), frame(2), frame(3), frame(4)});
  const auto renamed = [&](const std::string& from, const std::string& to) {
    text.replace(text.find(from), from.size(), to);
  };
  renamed("images/frame_1.png", "/home/me/scene/images/frame_1.png");
  renamed("images/frame_2.png", "C:\\\\scene\\\\images\\\\frame_2");
  renamed("images/frame_3.png", "../scene/images/frame_3.png");
  renamed("images/frame_4.png", "images/FRAME_4.PNG");
  make_nerfstudio(folder, text);
  SceneOptions options;
  options.test_every = 0;
  const Scene scene = read_scene(folder.path(), options);
  ASSERT_EQ(scene.train.size(), 4u);
  for (int k = 0; k < 4; ++k)
    EXPECT_EQ(scene.train[size_t(k)].path, folder.file(fmt::format("images/frame_{}.png", k + 1)));
  renamed("/home/me/scene/images/frame_1.png", "/home/me/scene/images/none.png");
  make_nerfstudio(folder, text);
  expect_error([&] { read_scene(folder.path()); }, {"none.png", "outside of the scene folder"});
}

TEST(Nerfstudio, IntrinsicsMayBeDividedByTheSizeOrOfLargerImages) {
  const TemporaryFolder folder;
  const auto camera_with = [&](const std::string& top) {
    make_nerfstudio(folder, joined({frame(1), frame(2)}), top);
    Scene scene = read_scene(folder.path());
    EXPECT_EQ(scene.notices.size(), 1u);
    return scene.cameras[0];
  };
  const Camera divided = camera_with(R"("fl_x": 1.25, "fl_y": 1.5, "cx": 0.5, "cy": 0.4)");
  EXPECT_NEAR(divided.fx, 10, 1e-12);
  EXPECT_NEAR(divided.fy, 9, 1e-12);
  EXPECT_NEAR(divided.cx, 4, 1e-12);
  EXPECT_NEAR(divided.cy, 2.4, 1e-12);
  const Camera larger = camera_with(R"("fl_x": 20, "fl_y": 22, "cx": 8, "cy": 6)");  // 16x12
  EXPECT_NEAR(larger.fx, 10, 1e-12);
  EXPECT_NEAR(larger.fy, 11, 1e-12);
  EXPECT_NEAR(larger.cx, 4, 1e-12);
}

TEST(Nerfstudio, PosesOfAScaledCameraObjectAreRotations) {
  const TemporaryFolder folder;
  std::string scaled = frame(1);
  const std::string unit = "[[1,0,0,10],[0,1,0,2],[0,0,1,3]";
  scaled.replace(scaled.find(unit), unit.size(), "[[3,0,0,10],[0,3,0,2],[0,0,3,3]");
  make_nerfstudio(folder, joined({frame(1), frame(2)}));
  const Scene expected = read_scene(folder.path());
  make_nerfstudio(folder, joined({scaled, frame(2)}));
  EXPECT_EQ(read_scene(folder.path()).cameras[0].viewmat, expected.cameras[0].viewmat);
}
