// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/scene.hpp"
#include "tests/support/scene_files.hpp"

using namespace gflow;

TEST(Consistent4d, NumberedImagesAreOneStaticCameraThatLooksAtTheOrigin) {
  const TemporaryFolder folder;
  for (int k = 0; k < 12; ++k) make_png(folder, fmt::format("{}.png", k), 8, 8, 4);
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.layout, "consistent4d");
  EXPECT_TRUE(scene.has_alpha);
  ASSERT_EQ(scene.train.size(), 12u);
  EXPECT_EQ(std::filesystem::path(scene.train[10].path).filename(), "10.png");  // not after 1.png
  EXPECT_NEAR(scene.train[1].time, 1 / 11., 1e-12);
  EXPECT_EQ(scene.test.size(), 12u);
  EXPECT_EQ(neighbour_pairs(scene).size(), 11u);
  EXPECT_NEAR(scene.extent, 2, 1e-12);

  const Camera& camera = scene.cameras[0];
  EXPECT_TRUE(camera.position().isApprox(Eigen::Vector3d(2, 0, 0)));
  EXPECT_TRUE(camera.project({0, 0, 0}).isApprox(Eigen::Vector2d(4, 4)));
  // Seen from +x with z up, +y is to the right and +z is above. f = 4 / tan(24.55 deg) = 8.7566
  EXPECT_NEAR(camera.project({0, 0.5, 0}).x(), 4 + 8.7566 / 4, 1e-3);
  EXPECT_NEAR(camera.project({0, 0, 0.5}).y(), 4 - 8.7566 / 4, 1e-3);
}

TEST(Consistent4d, EvaluationViewsStandAtTheirAzimuths) {
  const TemporaryFolder folder;
  for (const char* view : {"input", "eval_0", "eval_1"})
    for (int k = 0; k < 2; ++k) make_png(folder, fmt::format("{}/{}.png", view, k), 8, 8, 4);
  SceneOptions options;
  options.radius = 3;
  options.elevation = 30;
  const Scene scene = read_scene(folder.path(), options);
  EXPECT_EQ(scene.train.size(), 2u);
  ASSERT_EQ(scene.test.size(), 4u);
  EXPECT_EQ(scene.test[3].name, "eval_1_0001");
  // r (cos 30 cos az, cos 30 sin az, sin 30)
  const Eigen::Vector3d at_minus_75(2.5980762 * 0.2588190, 2.5980762 * -0.9659258, 1.5);
  EXPECT_LT((scene.cameras[1].position() - at_minus_75).norm(), 1e-6);
}

TEST(Consistent4d, UnequalViewsAndImpossibleCamerasAreRefused) {
  const TemporaryFolder folder;
  make_png(folder, "input/0.png", 8, 8, 4);
  make_png(folder, "input/1.png", 8, 8, 4);
  make_png(folder, "eval_2/0.png", 8, 8, 4);
  expect_error([&] { read_scene(folder.path()); }, {"eval_2", "1 images", "2"});
  SceneOptions options;
  options.elevation = 90;
  expect_error([&] { read_scene(folder.path(), options); }, {"scene.elevation is 90"});
  options.elevation = 0;
  options.radius = 0;
  expect_error([&] { read_scene(folder.path(), options); }, {"scene.radius"});
  options.radius = 1;
  options.fovy = 180;
  expect_error([&] { read_scene(folder.path(), options); }, {"scene.fovy"});
}

TEST(Consistent4d, PlainImagesNamedByAWordAndANumberAreAVideoToo) {
  const TemporaryFolder folder;
  for (int k : {2, 10, 1})  // names as by ffmpeg; a JPEG by its first bytes, not its name
    make_png(folder, fmt::format("frame_{}.jpg", k), 8, 6, 3);
  make_png(folder, "cover.png", 4, 4, 3);  // a name without a number
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.layout, "consistent4d");
  EXPECT_FALSE(scene.has_alpha);
  ASSERT_EQ(scene.train.size(), 3u);
  EXPECT_EQ(std::filesystem::path(scene.train[2].path).filename(), "frame_10.jpg");
  make_png(folder, "other_1.png", 8, 6, 3);  // two candidate sequences are ambiguous
  expect_error([&] { read_scene(folder.path()); }, {"no known scene layout"});
}

TEST(Consistent4d, ImagesLeftOutLeaveAGapInTime) {
  const TemporaryFolder folder;
  for (int k : {3, 4, 7}) make_png(folder, fmt::format("frame_{:03}.png", k));
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.steps, 3);
  EXPECT_EQ(scene.train[1].step, 1);
  EXPECT_EQ(scene.train[1].time, 0.25);
  make_png(folder, "frame_4.jpg");  // a duplicate number gives no order in time
  EXPECT_NEAR(read_scene(folder.path()).train[1].time, 1 / 3., 1e-12);
}

TEST(Consistent4d, TheInputCameraMayBeGivenOrMove) {
  const TemporaryFolder folder;
  for (const char* view : {"input", "eval_0"})
    for (int k = 0; k < 2; ++k) make_png(folder, fmt::format("{}/{}.png", view, k), 8, 8, 4);
  const auto pose = [](int x) {
    return fmt::format(R"({{"transform_matrix":[[1,0,0,{}],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}})", x);
  };
  SceneOptions options;
  options.cameras = folder.write("one.json", R"({"camera_angle_x":1,"frames":[)" + pose(0) + "]}");
  const Scene one = read_scene(folder.path(), options);
  EXPECT_TRUE(one.cameras[0].position().isApprox(Eigen::Vector3d(0, 0, 4)));
  EXPECT_EQ(one.cameras.size(), 2u);
  options.cameras = folder.write(
      "two.json", R"({"camera_angle_x":1,"frames":[)" + pose(0) + "," + pose(1) + "]}");
  const Scene two = read_scene(folder.path(), options);
  ASSERT_EQ(two.cameras.size(), 3u);
  EXPECT_EQ(two.train[1].camera, 1);
  EXPECT_EQ(two.test[0].camera, 2);
  EXPECT_NE(two.test[0].track, two.train[0].track);
  EXPECT_EQ(neighbour_pairs(two).size(), 1u);
}

namespace {

// A transforms file of cameras with these names; number k is at (k, 0, 4).
std::string cameras_file(const TemporaryFolder& folder, const std::vector<std::string>& names) {
  std::string frames;
  for (size_t k = 0; k < names.size(); ++k)
    frames += fmt::format(
        R"({}{{"file_path": "{}", "transform_matrix":[[1,0,0,{}],[0,1,0,0],[0,0,1,4],[0,0,0,1]]}})",
        k ? "," : "", names[k], k);
  return folder.write("cameras.json", R"({"camera_angle_x":1,"frames":[)" + frames + "]}");
}

double x_of(const Scene& scene, const Frame& frame) {
  return scene.cameras[size_t(frame.camera)].position().x();
}

}  // namespace

// COLMAP does not register every image.
TEST(Consistent4d, ImagesWithoutACameraOfTheirNameAreLeftOutAndTold) {
  const TemporaryFolder folder;
  for (int k = 1; k <= 5; ++k) make_png(folder, fmt::format("frame_{:05}.png", k), 8, 8, 3);
  SceneOptions options;
  options.cameras = cameras_file(
      folder, {"images/frame_00004.jpg", "images/frame_00002.jpg", "images/frame_00009.jpg"});
  const Scene scene = read_scene(folder.path(), options);
  ASSERT_EQ(scene.train.size(), 2u);
  EXPECT_EQ(scene.steps, 2);
  EXPECT_EQ(scene.cameras.size(), 2u);
  EXPECT_EQ(std::filesystem::path(scene.train[0].path).filename(), "frame_00002.png");
  EXPECT_EQ(x_of(scene, scene.train[0]), 1);
  EXPECT_EQ(x_of(scene, scene.train[1]), 0);
  EXPECT_EQ(scene.train[0].time, 0);
  EXPECT_EQ(scene.train[1].time, 1);
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_EQ(scene.notices[0], "3 of 5 images in " + folder.path() + " are left out: " +
                                  options.cameras + " has no camera of their name");
}

TEST(Consistent4d, EvaluationViewsKeepTheTimesOfImagesLeftOut) {
  const TemporaryFolder folder;
  for (const char* view : {"input", "eval_0"})
    for (int k = 0; k < 5; ++k) make_png(folder, fmt::format("{}/{}.png", view, k), 8, 8, 4);
  SceneOptions options;
  options.cameras = cameras_file(folder, {"1", "2", "4"});
  const Scene scene = read_scene(folder.path(), options);
  EXPECT_EQ(scene.steps, 3);
  ASSERT_EQ(scene.train.size(), 3u);
  EXPECT_EQ(scene.train[0].time, 0.25);
  ASSERT_EQ(scene.test.size(), 5u);
  EXPECT_EQ(scene.test[2].time, 0.5);
  EXPECT_EQ(scene.test[2].step, 1);
  EXPECT_EQ(scene.test[4].step, 2);
}

TEST(Consistent4d, AsManyCamerasAsImagesBelongToThemInOrderUnlessAllNamesAgree) {
  const TemporaryFolder folder;
  for (int k = 0; k < 3; ++k) make_png(folder, fmt::format("{}.png", k), 8, 8, 3);
  SceneOptions options;
  options.cameras = cameras_file(folder, {"a/2.png", "b/1.png", "c/0.png"});
  Scene scene = read_scene(folder.path(), options);
  EXPECT_TRUE(scene.notices.empty());
  EXPECT_EQ(x_of(scene, scene.train.at(0)), 2);
  options.cameras = cameras_file(folder, {"1.png", "2.png", "3.png"});  // counted from 1
  scene = read_scene(folder.path(), options);
  EXPECT_EQ(x_of(scene, scene.train.at(0)), 0);
  EXPECT_EQ(x_of(scene, scene.train.at(2)), 2);
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_NE(scene.notices[0].find("in order, though only 2 of 3 names agree"), std::string::npos);
  for (const auto& names : {std::vector<std::string>{"x", "y"}, {"a/0.png", "b/0.png"}}) {
    options.cameras = cameras_file(folder, names);
    expect_error([&] { read_scene(folder.path(), options); }, {"2 cameras", "3 images", "names"});
  }
}

TEST(Consistent4d, TransformsBesideTheInputViewDoNotMatter) {
  const TemporaryFolder folder;
  make_png(folder, "input/0.png", 8, 8, 4);
  folder.write("transforms_train.json", "not read");
  EXPECT_EQ(read_scene(folder.path()).layout, "consistent4d");
}

TEST(Consistent4d, TransformsWinOverNumberedImagesInTheFolderItself) {
  const TemporaryFolder folder;
  make_png(folder, "0.png", 8, 8, 4);
  folder.write("transforms_train.json", "is read");
  expect_error([&] { read_scene(folder.path()); }, {"transforms_train.json", "not valid JSON"});
}

TEST(Consistent4d, FirstViewsAreTrainedOnWhereTheyAreGiven) {
  const TemporaryFolder folder;
  for (const char* view : {"input", "eval_0", "eval_1"})
    for (int k = 0; k < 3; ++k) make_png(folder, fmt::format("{}/{}.png", view, k), 8, 8, 4);
  SceneOptions options;
  options.first_views = true;
  const Scene scene = read_scene(folder.path(), options);
  EXPECT_EQ(scene.steps, 3);
  ASSERT_EQ(scene.train.size(), 5u);
  EXPECT_EQ(scene.train[3].name, "eval_0_0000");
  EXPECT_EQ(scene.train[4].name, "eval_1_0000");
  EXPECT_EQ(scene.train[4].time, 0);
  ASSERT_EQ(scene.test.size(), 4u);  // evaluated on frames that training did not use
  EXPECT_EQ(scene.test[0].name, "eval_0_0001");
  EXPECT_EQ(neighbour_pairs(scene).size(), 2u);  // pairs of the input view only
  for (int k = 0; k < 2; ++k) std::filesystem::remove_all(folder.file(fmt::format("eval_{}", k)));
  expect_error([&] { read_scene(folder.path(), options); }, {"scene.first_views", "eval_0"});
}
