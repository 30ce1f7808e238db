// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <map>

#include "optim/formats/npy.hpp"
#include "optim/scene/scene.hpp"
#include "tests/support/scene_files.hpp"

using namespace gflow;

namespace {

// LLFF row of a camera at (x, 0, 0) that looks along world +z with world +y downwards: the columns
// of R are down = y, right = x, backwards = -z. Stored size 6 x 8 (height x width), focal 10.
std::vector<double> row(double x) {
  return {0, 1, 0,  x, 6,  //
          1, 0, 0,  0, 8,  //
          0, 0, -1, 0, 10, 0.5, 9};
}

void make_poses(const TemporaryFolder& folder, size_t cameras,
                const std::string& name = "poses_bounds.npy") {
  std::vector<double> values;
  for (size_t i = 0; i < cameras; ++i)
    for (double value : row(double(i))) values.push_back(value);
  write_npy(folder.file(name), {{cameras, 17}, values});
}

// Three cameras with images of two time steps.
void make_n3v(const TemporaryFolder& folder) {
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < 2; ++k)
      make_png(folder, fmt::format("cam{:02}/images/{:04}.png", c, k), 8, 6, 3, c + 3 * k);
  make_poses(folder, 3);
}

// The place of each camera, from its row: (row, 0, 0).
std::map<std::string, double> rows_of_cameras(const Scene& scene) {
  std::map<std::string, double> rows;
  for (const Camera& one : scene.cameras) rows[one.name] = one.position().x();
  return rows;
}

}  // namespace

TEST(N3v, LlffPosesBecomeViewMatrices) {
  const TemporaryFolder folder;
  make_n3v(folder);
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.layout, "n3v");
  ASSERT_EQ(scene.cameras.size(), 3u);
  EXPECT_TRUE(scene.cameras[2].position().isApprox(Eigen::Vector3d(2, 0, 0)));
  // From camera 0 the point (1, 2, 5) is to the right and below.
  const Eigen::Vector2d pixel = scene.cameras[0].project({1, 2, 5});
  EXPECT_NEAR(pixel.x(), 4 + 10 * 1 / 5., 1e-9);
  EXPECT_NEAR(pixel.y(), 3 + 10 * 2 / 5., 1e-9);
}

TEST(N3v, HoldsOutTheFirstCameraOrTheOneAskedFor) {
  const TemporaryFolder folder;
  make_n3v(folder);
  Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.train.size(), 4u);
  ASSERT_EQ(scene.test.size(), 2u);
  EXPECT_EQ(scene.test[1].name, "cam00_0001");
  EXPECT_EQ(scene.test[1].time, 1);
  EXPECT_EQ(neighbour_pairs(scene).size(), 2u);
  EXPECT_NEAR(scene.extent, 1.1 * 0.5, 1e-12);  // training cameras at x = 1 and 2
  SceneOptions options;
  options.holdout = 2;
  EXPECT_EQ(read_scene(folder.path(), options).test[0].name, "cam02_0000");
  options.holdout = -1;
  EXPECT_TRUE(read_scene(folder.path(), options).test.empty());
  options.holdout = 3;
  expect_error([&] { read_scene(folder.path(), options); }, {"scene.holdout is 3", "0 to 2"});
}

TEST(N3v, IntrinsicsFollowTheImageSize) {
  const TemporaryFolder folder;
  for (int c = 0; c < 2; ++c) make_png(folder, fmt::format("cam{:02}/images/0.png", c), 4, 3);
  make_poses(folder, 2);
  const Camera camera = read_scene(folder.path()).cameras[1];
  EXPECT_EQ(camera.width, 4);
  EXPECT_NEAR(camera.fx, 5, 1e-12);
  EXPECT_NEAR(camera.cy, 1.5, 1e-12);
}

TEST(N3v, VideosServeWhereThereAreNoImages) {
  const TemporaryFolder folder;
  const std::vector<Image> frames(3, pattern(8, 6));
  make_mp4(folder.file("cam00.mp4"), frames, 20);
  make_mp4(folder.file("cam01.mp4"), frames, 20);
  make_png(folder, "cam00/images/0000.png");  // images take precedence: one common step
  make_poses(folder, 2);
  Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.steps, 1);
  EXPECT_EQ(scene.test[0].video_frame, -1);
  EXPECT_EQ(scene.train[0].video_frame, 0);
  std::filesystem::remove_all(folder.file("cam00/images"));
  scene = read_scene(folder.path());
  EXPECT_EQ(scene.steps, 3);
  EXPECT_EQ(scene.fps, 20);
  EXPECT_EQ(scene.train[2].video_frame, 2);
  SceneOptions options;
  options.max_steps = 2;
  EXPECT_EQ(read_scene(folder.path(), options).train.size(), 2u);
}

TEST(N3v, OneImageACameraIsAStaticSceneOfTheSmallestSize) {
  const TemporaryFolder folder;
  for (int c : {10, 9, 8}) {
    make_png(folder, fmt::format("images/{}.png", c), 16, 12);
    make_png(folder, fmt::format("images_2/{}.png", c), 8, 6);
  }
  make_poses(folder, 3);
  Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.steps, 1);
  EXPECT_EQ(scene.cameras[0].width, 8);
  EXPECT_EQ(scene.cameras[0].name, "8");  // natural order: 8, 9, 10
  EXPECT_EQ(scene.train.size(), 2u);
  EXPECT_TRUE(neighbour_pairs(scene).empty());
  SceneOptions options;
  options.images = "images";
  EXPECT_EQ(read_scene(folder.path(), options).cameras[0].width, 16);
  options.images = "images_8";
  expect_error([&] { read_scene(folder.path(), options); }, {"no images", "images_8"});
}

TEST(N3v, RowsAreInTheOrderOfNamesAsText) {
  const std::string notice =
      "row i of poses_bounds.npy belongs to the i-th camera in the order of "
      "text, as LLFF writes it: ";
  const TemporaryFolder stills, folders, videos;
  for (const int k : {1, 2, 10}) {
    make_png(stills, fmt::format("images/image{}.png", k));
    make_png(folders, fmt::format("cam{}/images/0.png", k));
    make_mp4(videos.file(fmt::format("cam{}.mp4", k)), {pattern(8, 6)}, 20);
  }
  for (const TemporaryFolder* folder : {&stills, &folders, &videos}) {
    make_poses(*folder, 3);
    const std::string prefix = folder == &stills ? "image" : "cam";
    const Scene scene = read_scene(folder->path());
    EXPECT_EQ(
        rows_of_cameras(scene),
        (std::map<std::string, double>{{prefix + "1", 0}, {prefix + "10", 1}, {prefix + "2", 2}}));
    EXPECT_EQ(scene.cameras[1].name, prefix + "2");  // shown by number
    ASSERT_EQ(scene.notices.size(), 1u);
    EXPECT_EQ(scene.notices[0], fmt::format("{}{}1, {}10, {}2", notice, prefix, prefix, prefix));
  }
}

// "a-b.png" is before "a.png", though "a" is before "a-b".
TEST(N3v, RowsAreInTheOrderOfFileNamesWithTheirExtension) {
  const TemporaryFolder folder;
  for (const char* name : {"images/a.png", "images/a-b.png"}) make_png(folder, name);
  make_poses(folder, 2);
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(rows_of_cameras(scene), (std::map<std::string, double>{{"a-b", 0}, {"a", 1}}));
  EXPECT_TRUE(scene.notices.empty());
}

TEST(N3v, ImagesThatViewImgsDoesNotNameAreLeftOut) {
  const TemporaryFolder folder;
  for (const char* name : {"a", "b 1", "c", "d"}) {
    make_png(folder, fmt::format("images/{}.png", name));
    make_png(folder, fmt::format("images_2/{}.png", name), 4, 3);
  }
  folder.write("view_imgs.txt", "b 1.JPG\r\n\r\nimages/d.JPG");
  make_poses(folder, 2);
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(rows_of_cameras(scene), (std::map<std::string, double>{{"b 1", 0}, {"d", 1}}));
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_NE(scene.notices[0].find("2 of 4 images in"), std::string::npos) << scene.notices[0];
  EXPECT_NE(scene.notices[0].find("view_imgs.txt"), std::string::npos) << scene.notices[0];
  make_png(folder, "images_4/image000.png", 4, 3);
  expect_error([&] { read_scene(folder.path()); },
               {"view_imgs.txt names none of the images in", "images_4", "scene.images"});
  std::filesystem::remove_all(folder.file("images_4"));
  make_poses(folder, 4);  // all have poses, whatever the list says
  EXPECT_EQ(read_scene(folder.path()).cameras.size(), 4u);
  make_poses(folder, 3);
  expect_error([&] { read_scene(folder.path()); }, {"has 3 rows", "2 cameras (b 1, d)"});
}

// Its script copies the first images as image1.jpg, image2.jpg, ..., which LLFF sorts as text.
TEST(N3v, TheMultipleviewLayoutOf4dgaussiansIsRead) {
  const TemporaryFolder folder;
  for (const int k : {1, 2, 10})
    for (const int frame : {1, 2})
      make_png(folder, fmt::format("cam{:02}/frame_{:05}.png", k, frame));
  make_poses(folder, 3, "poses_bounds_multipleview.npy");
  folder.write("sparse_/cameras.txt", "7 SIMPLE_PINHOLE 8 6 10 4 3\n");
  folder.write("sparse_/images.txt", "1 1 0 0 0 -4 0 0 7 image1.jpg\n\n");
  folder.write("sparse_/points3D.txt", "1 2 4 6 10 20 30 0.1\n");
  Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.layout, "n3v");
  EXPECT_EQ(scene.steps, 2);
  EXPECT_EQ(rows_of_cameras(scene),
            (std::map<std::string, double>{{"cam01", 0}, {"cam10", 1}, {"cam02", 2}}));
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_EQ(scene.notices[0],
            "row i of poses_bounds_multipleview.npy belongs to the i-th camera by its number as "
            "text, as the script of 4DGaussians writes it: cam01, cam10, cam02");
  EXPECT_EQ(scene.points.xyz, (std::vector<double>{2, 4, 6}));
  write_point_cloud(folder.file("points3D_multipleview.ply"), {{1, 2, 3, 4, 5, 6}, {}});
  EXPECT_EQ(read_scene(folder.path()).points.size(), 2u);
  make_poses(folder, 3);  // preferred
  EXPECT_EQ(rows_of_cameras(read_scene(folder.path())),
            (std::map<std::string, double>{{"cam01", 0}, {"cam02", 1}, {"cam10", 2}}));
}

TEST(N3v, AVideoIsPreferredToImagesBesideIt) {
  const TemporaryFolder folder;
  for (const char* name : {"cam00.mp4", "cam01.mp4"})
    make_mp4(folder.file(name), std::vector<Image>(3, pattern(8, 6)), 20);
  make_png(folder, "cam00/thumbnail.png");
  make_poses(folder, 2);
  EXPECT_EQ(read_scene(folder.path()).steps, 3);
}

TEST(N3v, TrueFlowAndDepthAreFound) {
  const TemporaryFolder folder;
  make_n3v(folder);
  write_flo(folder.file("flow/cam01/0000.flo.gz"), zero_flow(8, 6));
  make_png(folder, "flow/cam01/0000_mask.png", 8, 6, 1);
  folder.write("depth/cam01/0000.npy", "");
  const Scene scene = read_scene(folder.path());
  const Frame& frame = scene.train[0];
  EXPECT_EQ(frame.name, "cam01_0000");
  EXPECT_FALSE(frame.flow_path.empty());
  EXPECT_FALSE(frame.flow_mask_path.empty());
  EXPECT_FALSE(frame.depth_path.empty());
  EXPECT_EQ(frame.flow_time, 1);
  EXPECT_TRUE(scene.train[1].flow_path.empty());
}

TEST(N3v, PointsOfColmapAreAlignedByTheNamesOfCameras) {
  const TemporaryFolder folder;
  make_n3v(folder);
  folder.write("sparse/0/cameras.txt", "7 SIMPLE_PINHOLE 8 6 10 4 3\n");
  folder.write("sparse/0/points3D.txt", "1 2 4 6 10 20 30 0.1\n");
  const std::string images =  // twice as large
      "1 1 0 0 0 -4 0 0 7 cam02.png\n\n2 1 0 0 0 -2 0 0 7 cam01.png\n\n"
      "3 1 0 0 0 0 0 0 7 cam00.png\n\n4 1 0 0 0 9 0 0 7 a.png\n\n";
  folder.write("sparse/0/images.txt", images);
  Scene scene = read_scene(folder.path());
  EXPECT_TRUE(scene.notices.empty());
  ASSERT_EQ(scene.points.size(), 1u);
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(scene.points.xyz[i], double(i + 1), 1e-12);
  folder.write("sparse/0/images.txt", std::string(images).replace(images.find("-2 0"), 4, "-2 9"));
  scene = read_scene(folder.path());
  EXPECT_EQ(scene.points.size(), 0u);
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_NE(scene.notices[0].find("its cameras do not agree with those of poses_bounds.npy"),
            std::string::npos);
  folder.write("sparse/0/images.txt", images.substr(images.find("3 1")));
  scene = read_scene(folder.path());
  EXPECT_EQ(scene.points.xyz, (std::vector<double>{2, 4, 6}));
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_NE(scene.notices[0].find("are used as they are"), std::string::npos);
}

TEST(N3v, ScenesThatContradictThemselvesAreRefused) {
  const TemporaryFolder folder;
  make_n3v(folder);
  const auto read = [&] { read_scene(folder.path()); };
  make_poses(folder, 4);
  expect_error(read, {"poses_bounds.npy has 4 rows", "of 3 cameras (cam00, cam01, cam02)"});
  write_npy(folder.file("poses_bounds.npy"), {{3, 16}, std::vector<double>(48)});
  expect_error(read, {"(3, 16)", "(cameras, 17)"});
  std::vector<double> values;
  for (int i = 0; i < 3; ++i)
    for (double value : row(i)) values.push_back(value);
  values[17 + 3] = std::nan("");
  write_npy(folder.file("poses_bounds.npy"), {{3, 17}, values});
  expect_error(read, {"row 1", "poses_bounds.npy", "NaN or Inf"});
  values[17 + 3] = 0;
  values[17 + 14] = -10;
  write_npy(folder.file("poses_bounds.npy"), {{3, 17}, values});
  expect_error(read, {"row 1", "focal length -10"});
  values[17 + 14] = 10;
  for (const auto& [near, far] : {std::pair(-1., 5.), {1., HUGE_VAL}, {5., 5.}, {0., 5.}}) {
    values[17 + 15] = near, values[17 + 16] = far;
    write_npy(folder.file("poses_bounds.npy"), {{3, 17}, values});
    expect_error(read, {"row 1", "poses_bounds.npy", "depth bounds"});
  }
  values[17 + 15] = values[17 + 16] = 0;
  write_npy(folder.file("poses_bounds.npy"), {{3, 17}, values});
  EXPECT_NO_THROW(read());
  folder.write("poses_bounds.npy", "text");
  expect_error(read, {"poses_bounds.npy"});
  make_poses(folder, 3);
  make_png(folder, "cam01/images/0000.png", 8, 8);
  expect_error(read, {"8x8", "8x6", "cam01"});
}

TEST(N3v, StepsThatOneCameraLacksAreToldAndLeftOut) {
  const TemporaryFolder folder;
  make_n3v(folder);
  EXPECT_TRUE(read_scene(folder.path()).notices.empty());
  for (const int camera : {0, 2})
    make_png(folder, fmt::format("cam{:02}/images/0002.png", camera), 8, 6);
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.steps, 2);
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_EQ(scene.notices[0],
            "using only the 2 of 3 time steps that all cameras have: cam01 has no more");
}

TEST(N3v, CamerasMayBeLeftOut) {
  const TemporaryFolder folder;
  make_n3v(folder);
  for (const int camera : {0, 1})  // the camera to leave out is shorter than the others
    make_png(folder, fmt::format("cam{:02}/images/0002.png", camera), 8, 6);
  SceneOptions options;
  options.skip_cameras = " cam02,";
  Scene scene = read_scene(folder.path(), options);
  EXPECT_EQ(scene.steps, 3);
  EXPECT_TRUE(scene.notices.empty());
  ASSERT_EQ(scene.cameras.size(), 2u);
  EXPECT_EQ(scene.test.at(0).name, "cam00_0000");
  ASSERT_EQ(scene.train.size(), 3u);
  EXPECT_EQ(scene.train[2].name, "cam01_0002");
  EXPECT_EQ(scene.cameras[size_t(scene.train[2].camera)].position().x(), 1);
  options.skip_cameras = "cam01";
  options.holdout = 2;  // counts all cameras
  EXPECT_EQ(read_scene(folder.path(), options).test.at(0).name, "cam02_0000");
  options.skip_cameras = "cam01,cam02";
  scene = read_scene(folder.path(), options);
  EXPECT_TRUE(scene.test.empty());
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_NE(scene.notices[0].find("leaves out the test camera cam02"), std::string::npos);
  options.skip_cameras = "cam02,cam2";
  expect_error([&] { read_scene(folder.path(), options); },
               {"scene.skip_cameras names camera 'cam2'", "has cam00, cam01, cam02"});
  options.skip_cameras = "cam00,cam01,cam02";
  expect_error([&] { read_scene(folder.path(), options); }, {"leaves no camera"});
}

TEST(N3v, RowsOfCamerasWithoutVideoAreLeftOutByTheirNames) {
  const TemporaryFolder folder;
  make_n3v(folder);
  make_poses(folder, 5);
  SceneOptions options;
  options.skip_cameras = "cam005, cam01,cam02b";  // as text: cam00, cam005, cam01, cam02, cam02b
  const Scene scene = read_scene(folder.path(), options);
  EXPECT_EQ(rows_of_cameras(scene), (std::map<std::string, double>{{"cam00", 0}, {"cam02", 3}}));
  ASSERT_EQ(scene.notices.size(), 3u);
  EXPECT_NE(scene.notices[0].find("cam00, cam005, cam01, cam02, cam02b"), std::string::npos);
  EXPECT_EQ(scene.notices[1],
            "row 1 of poses_bounds.npy is left out as that of cam005, which has no images");
  EXPECT_EQ(scene.notices[2],
            "row 4 of poses_bounds.npy is left out as that of cam02b, which has no images");
  options.skip_cameras = "cam01,cam5";
  expect_error([&] { read_scene(folder.path(), options); },
               {"has 5 rows", "of 3 cameras (cam00, cam01, cam02)", "scene.skip_cameras"});
}

TEST(N3v, CamerasWithoutARowAreLeftOutByTheirNames) {
  const TemporaryFolder folder;
  make_n3v(folder);
  make_poses(folder, 2);
  SceneOptions options;
  options.skip_cameras = "cam00";
  const Scene scene = read_scene(folder.path(), options);
  EXPECT_EQ(rows_of_cameras(scene), (std::map<std::string, double>{{"cam01", 0}, {"cam02", 1}}));
  ASSERT_EQ(scene.notices.size(), 2u);
  EXPECT_EQ(scene.notices[0],
            "poses_bounds.npy is taken to have no row for cam00, left out by scene.skip_cameras: "
            "its rows belong to the other cameras");
  EXPECT_NE(scene.notices[1].find("leaves out the test camera cam00"), std::string::npos);
}

TEST(N3v, OfManyCamerasAnErrorNamesTheFirst) {
  const TemporaryFolder folder;
  for (int c = 0; c < 14; ++c) make_png(folder, fmt::format("cam{:02}/images/0.png", c));
  make_poses(folder, 15);
  expect_error([&] { read_scene(folder.path()); }, {"cam11 and 2 more)"});
}

TEST(N3v, CamerasOutOfSyncAreShiftedInTime) {
  const TemporaryFolder folder;
  for (int c = 0; c < 3; ++c)
    for (int k = 0; k < 5; ++k) make_png(folder, fmt::format("cam{:02}/images/{:04}.png", c, k));
  make_poses(folder, 3);
  SceneOptions options;
  options.time_offsets = "cam01=+0.5, cam02 = -1";
  const Scene scene = read_scene(folder.path(), options);
  EXPECT_EQ(scene.steps, 5);
  EXPECT_EQ(scene.test.size(), 5u);
  ASSERT_EQ(scene.train.size(), 8u);
  for (size_t k = 0; k < 4; ++k) {
    const Frame &half = scene.train[k], &whole = scene.train[4 + k];
    EXPECT_EQ(half.name, fmt::format("cam01_{:04}", k));
    EXPECT_EQ(half.time, 0.25 * double(k) + 0.125);
    EXPECT_EQ(half.step, int(k));
    EXPECT_EQ(whole.name, fmt::format("cam02_{:04}", k + 1));
    EXPECT_EQ(whole.time, 0.25 * double(k));
    EXPECT_EQ(whole.step, int(k));
  }
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_EQ(scene.notices[0],
            "2 frames are left out: scene.time_offsets moves them out of the video");
  for (const char* list : {"cam01", "cam01=", "cam01=x", "cam01=nan", "cam01=1.5f"}) {
    options.time_offsets = list;
    expect_error([&] { read_scene(folder.path(), options); },
                 {std::string("'") + list + "'", "expected NAME=NUMBER"});
  }
  options.time_offsets = "cam1=1";
  expect_error([&] { read_scene(folder.path(), options); },
               {"scene.time_offsets names camera 'cam1'"});
  options.time_offsets = "cam01=1";
  options.max_steps = 1;
  EXPECT_EQ(read_scene(folder.path(), options).train.size(),
            1u);  // cam02's; that of cam01 is later
}

TEST(N3v, CamerasWithoutACommonFrameAreRefused) {
  const TemporaryFolder folder;
  make_png(folder, "cam00/images/0000.png");
  make_png(folder, "cam01/images/0001.png");
  make_poses(folder, 2);
  expect_error([&] { read_scene(folder.path()); }, {"no frame in common"});
}

TEST(N3v, VideosOfDifferentRatesKeepTheirOwnTimes) {
  const TemporaryFolder folder;
  make_poses(folder, 3);
  for (const auto& [name, frames, fps] :
       {std::tuple{"cam00", 11, 10.}, {"cam01", 12, 10.}, {"cam02", 6, 5.}}) {
    std::vector<Image> images;
    for (int k = 0; k < frames; ++k) images.push_back(pattern(8, 6, 3, k));
    make_mp4(folder.file(std::string(name) + ".mp4"), images, fps);
  }
  const Scene scene = read_scene(folder.path());
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_NE(scene.notices[0].find("different frame rates"), std::string::npos);
  EXPECT_EQ(scene.steps, 11);
  EXPECT_NEAR(scene.fps, 10, 1e-6);
  EXPECT_EQ(scene.test.size(), 11u);  // of the first camera
  ASSERT_EQ(scene.train.size(), 17u);
  const Frame& second = scene.train[12];  // of the slow camera, at 0.2 of 1 s
  EXPECT_EQ(second.video_frame, 1);
  EXPECT_NEAR(second.time, 0.2, 1e-6);
  EXPECT_EQ(second.step, 2);
}

TEST(N3v, MasksThatAreNotReadAreTold) {
  const TemporaryFolder folder;
  make_n3v(folder);
  make_png(folder, "masks/cam00/0000.png", 8, 6, 1);
  const Scene scene = read_scene(folder.path());
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_NE(scene.notices[0].find("/masks are not used"), std::string::npos);
}
