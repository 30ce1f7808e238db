// SPDX-License-Identifier: Apache-2.0
#include <filesystem>

#include "optim/scene/scene.hpp"
#include "tests/support/memory_of.hpp"
#include "tests/support/scene_files.hpp"

using namespace gflow;

namespace {

// Camera-to-world in OpenGL axes: at (1, 2, 3), unrotated, so it looks along world -z.
const char* const pose = "[[1,0,0,1],[0,1,0,2],[0,0,1,3],[0,0,0,1]]";
const char* const other_pose = "[[1,0,0,0],[0,1,0,0],[0,0,1,3],[0,0,0,1]]";

std::string frame(const std::string& file, const std::string& time, const std::string& matrix,
                  const std::string& more = "") {
  return fmt::format(R"({{"file_path": "{}", {}"transform_matrix": {}{}}})", file,
                     time.empty() ? "" : "\"time\": " + time + ", ", matrix, more);
}

std::string transforms(const std::string& frames, const std::string& top) {
  return fmt::format(R"({{{}, "frames": [{}]}})", top, frames);
}

// Writes transforms_train.json with these frames, and images train/a.png, b.png, c.png, 8x6.
void make_blender(const TemporaryFolder& folder, const std::string& frames,
                  const std::string& top = R"("camera_angle_x": 1.5707963267948966)") {
  for (const char* name : {"a", "b", "c"}) make_png(folder, fmt::format("train/{}.png", name));
  folder.write("transforms_train.json", transforms(frames, top));
}

}  // namespace

TEST(Blender, OpenGlPosesBecomeViewMatrices) {
  const TemporaryFolder folder;
  make_blender(folder, frame("./train/a", "0", pose));
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.layout, "blender");
  ASSERT_EQ(scene.cameras.size(), 1u);
  const Camera& camera = scene.cameras[0];
  EXPECT_EQ(camera.width, 8);
  EXPECT_NEAR(camera.fx, 4, 1e-12);  // 90 degrees over 8 pixels
  EXPECT_NEAR(camera.fy, 4, 1e-12);
  EXPECT_TRUE(camera.position().isApprox(Eigen::Vector3d(1, 2, 3)));
  // Two units ahead (-z), one to the right (+x) and one up (+y, towards smaller rows).
  const Eigen::Vector2d pixel = camera.project({2, 3, 1});
  EXPECT_NEAR(pixel.x(), 4 + 4 / 2., 1e-9);
  EXPECT_NEAR(pixel.y(), 3 - 4 / 2., 1e-9);
}

// The last column is the position, whatever the rotation.
TEST(Blender, ATurnedCameraStandsWhereItsPoseSays) {
  const TemporaryFolder folder;
  make_blender(folder,
               frame("./train/a", "0", "[[0, 0, 1, 1], [1, 0, 0, 2], [0, 1, 0, 3], [0, 0, 0, 1]]"));
  const Camera camera = read_scene(folder.path()).cameras.at(0);
  EXPECT_TRUE(camera.position().isApprox(Eigen::Vector3d(1, 2, 3)));
  // Ahead (-z of the camera) is the world's -x, right its +y, up its +z.
  const Eigen::Vector2d middle = camera.project({-1, 2, 3}), pixel = camera.project({-1, 3, 4});
  EXPECT_NEAR(middle.x(), 4, 1e-9);
  EXPECT_NEAR(middle.y(), 3, 1e-9);
  EXPECT_NEAR(pixel.x(), 4 + 4 / 2., 1e-9);
  EXPECT_NEAR(pixel.y(), 3 - 4 / 2., 1e-9);
}

TEST(Blender, ATransformsFileThatIsNotReadIsReported) {
  const TemporaryFolder folder;
  make_blender(folder, frame("./train/a", "0", pose));
  EXPECT_TRUE(read_scene(folder.path()).notices.empty());
  folder.write("transforms.json", "");
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.layout, "blender");
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_NE(scene.notices[0].find("transforms.json of " + folder.path() + " is not read"),
            std::string::npos);
}

TEST(Blender, EqualPosesAreOneCameraWithFlowPairsInTime) {
  const TemporaryFolder folder;
  make_blender(folder, frame("train/c", "1.0", pose) + "," +
                           frame("train/b.png", "0.5", other_pose) + "," +
                           frame("train/a", "0.0", pose));
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.cameras.size(), 2u);
  EXPECT_EQ(scene.steps, 3);
  const std::vector<FlowPair> pairs = neighbour_pairs(scene);
  ASSERT_EQ(pairs.size(), 1u);
  EXPECT_EQ(scene.train[size_t(pairs[0].frame)].name, "train_a");
  EXPECT_EQ(scene.train[size_t(pairs[0].next)].name, "train_c");
  EXPECT_EQ(scene.train[size_t(pairs[0].next)].step, 2);
}

// Cameras of layouts without their own names have that of their first image.
TEST(Blender, CamerasMayBeLeftOutAndShiftedInTime) {
  const TemporaryFolder folder;
  make_blender(folder, frame("train/a", "0", pose) + "," + frame("train/b", "0.5", other_pose) +
                           "," + frame("train/c", "1", pose));
  SceneOptions options;
  options.time_offsets = "train_b=0.5";
  EXPECT_EQ(read_scene(folder.path(), options).train.at(2).time, 0.75);
  options.time_offsets = "";
  options.skip_cameras = "train_b";
  const Scene scene = read_scene(folder.path(), options);
  EXPECT_EQ(scene.cameras.size(), 1u);
  EXPECT_EQ(scene.steps, 2);
  ASSERT_EQ(scene.train.size(), 2u);
  EXPECT_EQ(scene.train[1].name, "train_c");
  EXPECT_EQ(scene.train[1].step, 1);
  options.skip_cameras = "b.png";  // the end of the name, with the image's extension
  EXPECT_EQ(read_scene(folder.path(), options).train.size(), scene.train.size());
  options.skip_cameras = "train_c";
  expect_error([&] { read_scene(folder.path(), options); }, {"'train_c'", "train_a, train_b"});
}

TEST(Blender, TrueFlowMakesAPairWithoutANextFrame) {
  const TemporaryFolder folder;
  make_blender(folder, frame("train/a", "0", pose) + "," + frame("train/b", "0.5", other_pose) +
                           "," + frame("train/c", "1", other_pose));
  write_flo(folder.file("flow_train/a.flo.gz"), zero_flow(8, 6));
  make_png(folder, "flow_train/a_mask.png", 8, 6, 1);
  const Scene scene = read_scene(folder.path());
  const std::vector<FlowPair> pairs = neighbour_pairs(scene);
  ASSERT_EQ(pairs.size(), 2u);
  EXPECT_EQ(pairs[0].next, -1);
  const Frame& first = scene.train[size_t(pairs[0].frame)];
  EXPECT_EQ(first.name, "train_a");
  EXPECT_EQ(first.flow_time, 0.5);
  EXPECT_FALSE(first.flow_mask_path.empty());
}

// A test view without a time would be compared with time 0.
TEST(Blender, TimesAreInAllFilesOrNone) {
  const TemporaryFolder folder;
  const std::string top = R"("camera_angle_x": 1.0)";
  const auto with = [&](const std::string& train, const std::string& test) {
    make_blender(folder, frame("train/a", train, pose), top);
    folder.write("transforms_test.json", transforms(frame("train/b", test, pose), top));
    return read_scene(folder.path()).test.size();
  };
  EXPECT_EQ(with("", ""), 1u);
  EXPECT_EQ(with("0", "0.5"), 1u);
  expect_error([&] { with("0", ""); },
               {"transforms_test.json has no 'time'", "transforms_train.json have one"});
  expect_error([&] { with("", "0.5"); },
               {"transforms_test.json has a 'time'", "transforms_train.json have none"});
  folder.write("transforms_test.json", transforms("", top));
  EXPECT_TRUE(read_scene(folder.path()).test.empty());
}

// Seconds or frame numbers. The range is that of all splits.
TEST(Blender, TimesBeyondOneAreScaledTogetherAndTold) {
  const TemporaryFolder folder;
  make_blender(folder, frame("train/a", "2", pose) + "," + frame("train/b", "6", pose));
  folder.write("transforms_test.json",
               transforms(frame("train/c", "10", pose) + "," + frame("train/b", "5", pose),
                          R"("camera_angle_x": 1.0)"));
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.steps, 2);
  EXPECT_EQ(scene.train.at(0).time, 0);
  EXPECT_EQ(scene.train.at(1).time, 0.5);
  EXPECT_EQ(scene.test.at(0).time, 0.375);
  EXPECT_EQ(scene.test.at(1).time, 1);
  EXPECT_EQ(scene.test.at(1).step, 1);
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_EQ(scene.notices[0], "the times in " + folder.path() +
                                  "/transforms_*.json are 2 to 10: they are scaled to 0 to 1");
  make_blender(folder, frame("train/a", "7", pose) + "," + frame("train/b", "7", pose));
  std::filesystem::remove(folder.file("transforms_test.json"));
  EXPECT_EQ(read_scene(folder.path()).train.at(1).time, 0);
}

TEST(Blender, PointsOfColmapAreAlignedByTheImages) {
  const TemporaryFolder folder;
  const char* const third = "[[1,0,0,1],[0,1,0,0],[0,0,1,5],[0,0,0,1]]";
  make_blender(folder, frame("train/a", "0", pose) + "," + frame("train/b", "0.5", other_pose) +
                           "," + frame("train/c", "1", third));
  folder.write("transforms_test.json",
               transforms(frame("train/a", "0", pose), R"("camera_angle_x": 1.5707963267948966)"));
  folder.write("sparse/0/cameras.txt", "7 SIMPLE_PINHOLE 8 6 4 4 3\n");
  folder.write("sparse/0/points3D.txt", "1 2 4 6 10 20 30 0.1\n");
  // Twice as large: at (2, 4, 6), (0, 0, 6) and (2, 0, 10), turned by 180 degrees about x.
  folder.write("sparse/0/images.txt",
               "1 0 1 0 0 -2 4 6 7 a.jpg\n\n2 0 1 0 0 0 0 6 7 b.jpg\n\n"
               "3 0 1 0 0 -2 0 10 7 c.jpg\n\n");
  const Scene scene = read_scene(folder.path());
  EXPECT_TRUE(scene.notices.empty());
  ASSERT_EQ(scene.points.size(), 1u);
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(scene.points.xyz[i], double(i + 1), 1e-12);
}

TEST(Blender, IntrinsicsOfAFrameWinAndFollowTheImageSize) {
  const TemporaryFolder folder;
  make_blender(folder, frame("train/a", "", pose, R"(, "fl_x": 20, "fl_y": 22, "cx": 9, "cy": 5)"),
               R"("fl_x": 1, "w": 16, "h": 12)");
  const Camera camera = read_scene(folder.path()).cameras[0];
  EXPECT_EQ(camera.width, 8);  // half of the size in the file
  EXPECT_NEAR(camera.fx, 10, 1e-12);
  EXPECT_NEAR(camera.fy, 11, 1e-12);
  EXPECT_NEAR(camera.cx, 4.5, 1e-12);
  EXPECT_NEAR(camera.cy, 2.5, 1e-12);
}

TEST(Blender, EachAxisHasItsFieldOfView) {
  const TemporaryFolder folder;
  const auto camera = [&](const std::string& top) {
    make_blender(folder, frame("train/a", "", pose), top);
    return read_scene(folder.path()).cameras.at(0);
  };
  const auto expect = [](const Camera& camera, double fx, double fy) {
    EXPECT_NEAR(camera.fx, fx, 1e-9);
    EXPECT_NEAR(camera.fy, fy, 1e-9);
  };
  // 90 degrees over 8 x 6 pixels; 2 atan(3 / 8) = 0.71754...
  const std::string x = R"("camera_angle_x": 1.5707963267948966)";
  const std::string y = R"("camera_angle_y": 0.7175413405411445)";
  expect(camera(x + ", " + y), 4, 8);
  expect(camera(x), 4, 4);
  expect(camera(y), 8, 8);
  expect(camera(R"("fl_x": 5, )" + y), 5, 8);
  expect(camera(R"("fl_y": 5, )" + x + ", " + y), 4, 5);
  expect_error([&] { camera(x + R"(, "camera_angle_y": 4)"); }, {"camera_angle_y", "(0, pi)"});
}

TEST(Blender, FilesThatContradictThemselvesAreRefused) {
  const TemporaryFolder folder;
  const auto with = [&](const std::string& frames,
                        const std::string& top = R"("camera_angle_x": 1.0)") {
    make_blender(folder, frames, top);
    read_scene(folder.path());
  };
  const auto a = [](const std::string& matrix) { return frame("train/a", "0", matrix); };
  expect_error([&] { with(""); }, {"transforms_train.json", "no frames"});
  expect_error([&] { with(frame("train/x", "0", pose)); }, {"train/x", "without an image file"});
  expect_error([&] { with(frame("train", "0", pose)); }, {"'train'", "is a folder"});
  expect_error([&] { with(frame("../a", "0", pose)); }, {"'../a'", "relative path"});
  expect_error([&] { with(frame("train/../../a", "0", pose)); }, {"relative path"});
  expect_error([&] { with(frame("/etc/a", "0", pose)); }, {"'/etc/a'", "relative path"});
  expect_error([&] { with(frame("train/a", "-0.5", pose)); }, {"'time'", "-0.5", "0 or more"});
  expect_error([&] { with(frame("train/a", "\"x\"", pose)); }, {"'time'", "not a finite number"});
  expect_error([&] { with(frame("train/a", "0.5", pose) + ", " + frame("train/b", "", pose)); },
               {"frame 1 of", "has no 'time', but frame 0 has one"});
  expect_error([&] { with(a("[[1,0,0,null],[0,1,0,0],[0,0,1,0],[0,0,0,1]]")); },
               {"1 of 1 frames", "NaN or Inf", "train/a"});
  expect_error([&] { with(a("[[1,0,0,1e999],[0,1,0,0],[0,0,1,0],[0,0,0,1]]")); },
               {"transforms_train.json", "1e999"});
  expect_error([&] { with(a("[[1,0],[0,1]]")); },
               {"transform_matrix", "3x4 matrix of finite numbers"});
  expect_error([&] { with(a("[[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]")); }, {"not a rotation"});
  expect_error([&] { with(a("[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,2]]")); },
               {"last row", "transform_matrix", "0 0 0 2", "0 0 0 1"});
  expect_error([&] { with(a("[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1],[0,0,0,1]]")); },
               {"transform_matrix", "not a 3x4 matrix"});
  // Regardless of the other files.
  make_blender(folder, frame("train/a", "0", pose), R"("camera_angle_x": 1.0)");
  std::filesystem::copy_file(folder.file("transforms_train.json"),
                             folder.path() + "/transforms_test.json");
  expect_error([&] { with(""); }, {"transforms_train.json", "no frames"});
  std::filesystem::remove(folder.path() + "/transforms_test.json");
  expect_error([&] { with(a("[[-1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]")); }, {"right-handed"});
  expect_error([&] { with(a(pose), R"("x": 1)"); }, {"camera_angle_x", "fl_x"});
  expect_error([&] { with(a(pose), R"("camera_angle_x": 4)"); }, {"camera_angle_x", "(0, pi)"});
  expect_error([&] { with(a(pose), R"("fl_x": 9, "w": 8, "h": 8)"); }, {"8x6", "8x8"});
  for (const char* number : {"1e-300", "1e300"})
    expect_error([&] { with(a(pose), fmt::format(R"("fl_x": {})", number)); },
                 {"camera", "focal lengths 1e-6 to 1e6 times"});
  expect_error([&] { with(a(pose), R"("fl_x": 9, "cx": 1e30)"); },
               {"the principal point within 1e6 times"});
  expect_error([&] { with(a("[[1,0,0,1e300],[0,1,0,0],[0,0,1,0],[0,0,0,1]]")); },
               {"camera", "1e+300 from the origin"});
  expect_error([&] { with(frame("train/a\\ngflow: done", "0", pose)); },
               {"not a single-line string"});
  expect_error([&] { with(frame("train/a\\u0000b", "0", pose)); }, {"not a single-line string"});
}

TEST(Blender, WhatIsNoJsonIsRefused) {
  const TemporaryFolder folder;
  folder.write("transforms_train.json", R"({"frames": [)");
  expect_error([&] { read_scene(folder.path()); }, {"transforms_train.json", "not valid JSON"});
  folder.write("transforms_train.json", std::string("{\"frames\": []}\0garbage", 23));
  expect_error([&] { read_scene(folder.path()); }, {"transforms_train.json", "byte 14 is zero"});
  folder.write("transforms_train.json", "{\"x\": -" + std::string(size_t{1} << 20, '1') + "e400}");
  try {
    read_scene(folder.path());
    ADD_FAILURE() << "was read";
  } catch (const std::exception& refused) {
    EXPECT_LT(std::string(refused.what()).size(), 600u);
  }
  folder.write("transforms_train.json", R"([1, 2])");
  expect_error([&] { read_scene(folder.path()); }, {"'frames'"});
  folder.write("transforms_train.json", R"({"camera_angle_x": NAN, "frames": []})");
  expect_error([&] { read_scene(folder.path()); }, {"not valid JSON"});
  const auto nested = [](size_t depth) {
    return R"({"frames": )" + std::string(depth, '[') + std::string(depth, ']') + "}";
  };
  folder.write("transforms_train.json", nested(99));  // and the object
  expect_error([&] { read_scene(folder.path()); }, {"frame"});
  for (const size_t depth : {100, 1000000}) {
    folder.write("transforms_train.json", nested(depth));
    expect_error([&] { read_scene(folder.path()); }, {"nested more than 100 levels deep"});
  }
  folder.write("transforms_train.json", R"({"frames": "\")" + std::string(200, '[') + R"("})");
  expect_error([&] { read_scene(folder.path()); }, {"'frames'"});  // a string
  // Reading a long list must be linear: 300 000 entries took five minutes when it was quadratic.
  std::string many = R"({"camera_angle_x": 1, "frames": [{})";
  for (int i = 0; i < 300000; ++i) many += ",{}";
  folder.write("transforms_train.json", many + "]}");
  expect_error([&] { read_scene(folder.path()); }, {"file_path"});
  for (int i = 0; i < 3; ++i) many += many.substr(many.find(",{}"));
  folder.write("transforms_train.json", many + "]}");
  expect_error([&] { read_scene(folder.path()); }, {"values; at most 800000"});
  // Blanks before a syntax error would be quoted with eight characters each.
  folder.write("transforms_train.json", std::string(3 << 20, '\n') + "x");
  EXPECT_LT(memory_of([&] { EXPECT_THROW(read_scene(folder.path()), Error); }), 64);
  expect_error([&] { read_scene(folder.path()); }, {"3145728 consecutive whitespace characters"});
}
