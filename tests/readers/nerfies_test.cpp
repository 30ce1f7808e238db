// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "optim/formats/npy.hpp"
#include "optim/scene/scene.hpp"
#include "tests/support/scene_files.hpp"

using namespace gflow;

namespace {

// At (1, 2, 3 + k), looking along world +x: rows are the camera's right, down and forward axes.
std::string camera(int k, const std::string& more = "") {
  return fmt::format(
      R"({{"orientation": [[0, -1, 0], [0, 0, -1], [1, 0, 0]], "position": [1, 2, {}],
          "focal_length": 20, "principal_point": [9, 5], "skew": 0.0, "pixel_aspect_ratio": 1.1,
          "image_size": [16, 12]{}}})",
      3 + k, more);
}

// Four images 8x6 in rgb/2x, two of them for the test, times 4, 5, 6, 8.
void make_nerfies(const TemporaryFolder& folder) {
  for (int k = 0; k < 4; ++k) {
    make_png(folder, fmt::format("rgb/2x/{:06}.png", k));
    make_png(folder, fmt::format("rgb/4x/{:06}.png", k), 4, 3);
    folder.write(fmt::format("camera/{:06}.json", k), camera(k));
  }
  folder.write("dataset.json", R"({"count": 4, "ids": ["000000", "000001", "000002", "000003"],
      "train_ids": ["000000", "000002", "000003"], "val_ids": ["000001"]})");
  folder.write("metadata.json", R"({"000000": {"warp_id": 4, "appearance_id": 0},
      "000001": {"warp_id": 5}, "000002": {"warp_id": 6}, "000003": {"warp_id": 8}})");
  folder.write("scene.json", R"({"scale": 0.5, "center": [1, 0, 1], "near": 0.1, "far": 2})");
}

}  // namespace

TEST(Nerfies, CamerasAreMovedAndScaledIntoTheScene) {
  const TemporaryFolder folder;
  make_nerfies(folder);
  write_npy(folder.file("points.npy"), {{1, 3}, std::vector<float>{3, 4, 5}});
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.layout, "nerfies");
  ASSERT_EQ(scene.train.size(), 3u);
  ASSERT_EQ(scene.test.size(), 1u);
  EXPECT_EQ(scene.steps, 3);
  EXPECT_EQ(scene.train[1].time, 0.5);  // (6 - 4) / (8 - 4)
  EXPECT_EQ(scene.test[0].time, 0.25);
  EXPECT_EQ(scene.test[0].name, "000001");
  EXPECT_EQ(scene.points.xyz, (std::vector<double>{1, 2, 2}));
  const Camera& one = scene.cameras[size_t(scene.train[0].camera)];
  EXPECT_EQ(one.width, 8);
  EXPECT_TRUE(one.position().isApprox(Eigen::Vector3d(0, 1, 1)));  // ((1 2 3) - (1 0 1)) / 2
  // Two ahead (+x), one to the right (-y), one up (+z); half the stored size.
  const Eigen::Vector2d pixel = one.project({2, 0, 2});
  EXPECT_NEAR(pixel.x(), 4.5 + 10 / 2., 1e-12);
  EXPECT_NEAR(pixel.y(), 2.5 - 11 / 2., 1e-12);
}

// Output files are named after it.
TEST(Nerfies, AnIdWithFoldersIsANameWithout) {
  const TemporaryFolder folder;
  make_nerfies(folder);
  make_png(folder, "rgb/2x/sub/3.png");
  folder.write("camera/sub/3.json", camera(3));
  folder.write("dataset.json",
               R"({"train_ids": ["000000", "000002", "000003"], "val_ids": ["sub/3"]})");
  folder.write("metadata.json", R"({"000000": {"warp_id": 4}, "000002": {"warp_id": 6},
      "000003": {"warp_id": 8}, "sub/3": {"warp_id": 5}})");
  EXPECT_EQ(read_scene(folder.path()).test.at(0).name, "sub_3");
}

TEST(Nerfies, SplitsOfDyCheckReplaceTheListsOfTheDataset) {
  for (const char* test : {"val", "test"}) {
    const TemporaryFolder folder;
    make_nerfies(folder);
    folder.write("splits/train.json", R"({"frame_names": ["000001", "000002"],
        "camera_ids": [0, 0], "time_ids": [5, 9]})");
    folder.write(fmt::format("splits/{}.json", test), R"({"frame_names": ["000003"],
        "camera_ids": [1], "time_ids": [6]})");
    const Scene scene = read_scene(folder.path());
    ASSERT_EQ(scene.train.size(), 2u);
    ASSERT_EQ(scene.test.size(), 1u);
    EXPECT_EQ(scene.train[0].name, "000001");
    EXPECT_EQ(scene.train[1].name, "000002");
    EXPECT_EQ(scene.train[1].time, 1);
    EXPECT_EQ(scene.test[0].name, "000003");
    EXPECT_EQ(scene.test[0].time, 0.25);  // (6 - 5) / (9 - 5)
    ASSERT_EQ(scene.notices.size(), 1u);
    EXPECT_NE(scene.notices[0].find("1 of the 4 images in 'ids' of"), std::string::npos);
    EXPECT_NE(scene.notices[0].find("(000000)"), std::string::npos) << scene.notices[0];
  }
}

TEST(Nerfies, SplitsThatContradictThemselvesAreRefused) {
  const TemporaryFolder folder;
  make_nerfies(folder);
  const auto with = [&](const std::string& train) {
    folder.write("splits/train.json", train);
    read_scene(folder.path());
  };
  expect_error([&] { with("{}"); }, {"splits/train.json", "no 'frame_names'"});
  expect_error([&] { with(R"({"frame_names": [], "time_ids": []})"); },
               {"'frame_names' of", "splits/train.json is empty"});
  expect_error([&] { with(R"({"frame_names": ["000001"], "time_ids": [1, 2]})"); },
               {"'time_ids' of", "splits/train.json", "1 finite numbers"});
  expect_error([&] { with(R"({"frame_names": ["9"], "time_ids": [1]})"); },
               {"'9'", "splits/train.json", "there is no"});
  folder.write("splits/val.json", R"({"frame_names": ["000001"], "time_ids": [1]})");
  expect_error([&] { with(R"({"frame_names": ["000001"], "time_ids": [1]})"); },
               {"'000001' is listed in 'frame_names' of", "splits/val.json"});
}

TEST(Nerfies, ImagesInNoListAreReported) {
  const TemporaryFolder folder;
  make_nerfies(folder);
  EXPECT_TRUE(read_scene(folder.path()).notices.empty());
  folder.write("dataset.json", R"({"ids": ["000000", "000001", "000002", "000003"],
      "train_ids": ["000000", "000002"], "val_ids": []})");
  const Scene scene = read_scene(folder.path());
  ASSERT_EQ(scene.notices.size(), 1u);
  EXPECT_NE(scene.notices[0].find("2 of the 4 images in 'ids' of"), std::string::npos);
  EXPECT_NE(scene.notices[0].find("not used (000001, 000003)"), std::string::npos);
}

TEST(Nerfies, TheImagesAskedForAreUsed) {
  const TemporaryFolder folder;
  make_nerfies(folder);
  SceneOptions options;
  options.images = "4x";
  EXPECT_EQ(read_scene(folder.path(), options).cameras[0].width, 4);
  options.images = "8x";
  expect_error([&] { read_scene(folder.path(), options); }, {"no folder", "rgb/8x"});
}

TEST(Nerfies, DistortionHasItsPlaces) {
  const TemporaryFolder folder;
  for (const char* name : {"tangential", "tangential_distortion"}) {
    make_nerfies(folder);
    folder.write("camera/000000.json",
                 camera(0, fmt::format(R"(, "radial_distortion": [-0.1, 0.02, 0.003],
                                          "{}": [0.004, 0.005])",
                                       name)));
    const Scene scene = read_scene(folder.path());
    const Lens& lens = scene.cameras[size_t(scene.train[0].camera)].lens;
    EXPECT_EQ(lens.kind, Lens::Kind::radial);
    EXPECT_EQ(lens.k, (std::array<double, 8>{-.1, .02, .004, .005, .003})) << name;
  }
}

TEST(Nerfies, FilesThatContradictThemselvesAreRefused) {
  const TemporaryFolder folder;
  const auto with = [&](const std::string& name, const std::string& text) {
    make_nerfies(folder);
    folder.write(name, text);
    read_scene(folder.path());
  };
  const auto id = [](const std::string& fields) { return R"({"000000": {)" + fields + "}}"; };
  expect_error([&] { with("dataset.json", R"({"train_ids": [], "val_ids": []})"); },
               {"dataset.json", "'train_ids'", "empty"});
  expect_error([&] { with("dataset.json", R"({"ids": []})"); }, {"no 'train_ids'"});
  expect_error([&] { with("dataset.json", R"({"train_ids": ["9"]})"); }, {"'9'", "there is no"});
  expect_error([&] { with("dataset.json", R"({"train_ids": ["000000", "000000"]})"); },
               {"dataset.json", "'000000' is listed in 'train_ids' of", "and in 'train_ids' of"});
  expect_error([&] { with("dataset.json", R"({"train_ids": ["000000"], "val_ids": ["000000"]})"); },
               {"dataset.json", "'000000' is listed in 'train_ids' of", "and in 'val_ids' of"});
  expect_error([&] { with("dataset.json", R"({"train_ids": [9]})"); },
               {"train_ids", "not a string"});
  expect_error([&] { with("dataset.json", R"({"train_ids": ["../1"]})"); }, {"relative path"});
  expect_error([&] { with("dataset.json", R"({"train_ids": [)"); },
               {"dataset.json", "not valid JSON"});
  expect_error([&] { with("metadata.json", "{}"); }, {"metadata.json", "no '000000'"});
  expect_error([&] { with("metadata.json", id(R"("camera_id": 0)")); }, {"000000", "warp_id"});
  expect_error([&] { with("metadata.json", id(R"("warp_id": null)")); },
               {"'warp_id'", "not a finite number"});
  expect_error([&] { with("scene.json", R"({"scale": 0, "center": [0, 0, 0]})"); }, {"'scale'"});
  expect_error([&] { with("scene.json", R"({"scale": 1, "center": [0, 0]})"); },
               {"'center'", "3 finite numbers"});
  expect_error([&] { with("camera/000000.json", camera(0, R"(, "skew": 0.1)")); }, {"'skew'"});
  expect_error([&] { with("camera/000000.json", camera(0, R"(, "position": [0, 0, null])")); },
               {"'position'", "000000.json", "3 finite numbers"});
  expect_error([&] { with("camera/000000.json", camera(0, R"(, "image_size": [16, 16])")); },
               {"8x6", "16x16"});
  expect_error([&] { with("camera/000000.json", "{}"); }, {"000000.json", "no 'image_size'"});
  make_nerfies(folder);
  std::filesystem::remove(folder.file("camera/000003.json"));
  expect_error([&] { read_scene(folder.path()); }, {"000003.json"});
  make_nerfies(folder);
  std::filesystem::remove(folder.file("scene.json"));
  expect_error([&] { read_scene(folder.path()); }, {"scene.json"});
  make_nerfies(folder);
  std::filesystem::remove_all(folder.file("rgb"));
  expect_error([&] { read_scene(folder.path()); }, {"no images", "rgb"});
  make_nerfies(folder);
  for (const double place : {std::nan(""), 1e39, -1e200}) {
    write_npy(folder.file("points.npy"), {{2, 3}, std::vector<double>{0, 0, 0, 3, place, 5}});
    expect_error([&] { read_scene(folder.path()); },
                 {"point 1 of", "points.npy", "NaN, Inf or beyond 1e+18"});
  }
}
