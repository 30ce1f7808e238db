// SPDX-License-Identifier: Apache-2.0
#include <fmt/ranges.h>

#include "optim/formats/npz.hpp"
#include "optim/scene/scene.hpp"
#include "tests/support/memory_of.hpp"
#include "tests/support/scene_files.hpp"

using namespace gflow;

namespace {

const char* const k = "[[10, 0, 4.5], [0, 11, 3.5], [0, 0, 1]]";

// World-to-camera: camera c is at (-c, 0, -5), unrotated.
std::string w2c(int c) { return fmt::format("[[1,0,0,{}],[0,1,0,0],[0,0,1,5],[0,0,0,1]]", c); }

// The text it(t, c) for each time t and camera c, as nested lists.
template <class It>
std::string by_time(int times, const std::vector<int>& cameras, It it) {
  std::vector<std::string> rows;
  for (int t = 0; t < times; ++t) {
    std::vector<std::string> row;
    for (const int c : cameras) row.push_back(it(t, c));
    rows.push_back(fmt::format("[{}]", fmt::join(row, ", ")));
  }
  return fmt::format("[{}]", fmt::join(rows, ", "));
}

std::string meta(int times, const std::vector<int>& cameras,
                 const std::string& size = R"("w": 8, "h": 6)") {
  return fmt::format(
      R"({{{}, "k": {}, "w2c": {}, "fn": {}, "cam_id": {}}})", size,
      by_time(times, cameras, [](int, int) { return std::string(k); }),
      by_time(times, cameras, [](int, int c) { return w2c(c); }),
      by_time(times, cameras, [](int t, int c) { return fmt::format("\"{}/{:06}.jpg\"", c, t); }),
      by_time(times, cameras, [](int, int c) { return fmt::format("{}", c); }));
}

// Cameras 1 and 3 for training, 0 for the test, three times.
void make_panoptic(const TemporaryFolder& folder) {
  for (const int c : {0, 1, 3})
    for (int t = 0; t < 3; ++t) {
      make_png(folder, fmt::format("ims/{}/{:06}.jpg", c, t));
      make_png(folder, fmt::format("seg/{}/{:06}.png", c, t), 8, 6, 1);
    }
  folder.write("train_meta.json", meta(3, {1, 3}));
  folder.write("test_meta.json", meta(3, {0}));
}

void replace(const TemporaryFolder& folder, const std::string& what, const std::string& by) {
  std::string text = meta(3, {1, 3});
  const size_t at = text.find(what);
  ASSERT_NE(at, std::string::npos);
  folder.write("train_meta.json", text.replace(at, what.size(), by));
}

}  // namespace

TEST(Panoptic, CamerasByTimeBecomeTracks) {
  const TemporaryFolder folder;
  make_panoptic(folder);
  const Scene scene = read_scene(folder.path());
  EXPECT_EQ(scene.layout, "panoptic");
  EXPECT_EQ(scene.steps, 3);
  EXPECT_EQ(scene.fps, 30);
  EXPECT_EQ(scene.near_plane, 1);
  EXPECT_FALSE(scene.has_alpha);
  ASSERT_EQ(scene.train.size(), 6u);
  ASSERT_EQ(scene.test.size(), 3u);
  EXPECT_EQ(scene.cameras.size(), 3u);
  EXPECT_EQ(scene.train[4].name, "cam03_0001");
  EXPECT_EQ(scene.train[4].path, folder.file("ims/3/000001.jpg"));
  EXPECT_EQ(scene.train[4].time, 0.5);
  EXPECT_EQ(neighbour_pairs(scene).size(), 4u);
  const Camera& camera = scene.cameras[size_t(scene.train[4].camera)];
  EXPECT_EQ(camera.name, "cam03");
  EXPECT_TRUE(camera.position().isApprox(Eigen::Vector3d(-3, 0, -5)));
  // One to the right of the camera's axis, 5 + 5 ahead.
  EXPECT_TRUE(camera.project({-2, 1, 5}).isApprox(Eigen::Vector2d(4.5 + 1, 3.5 + 1.1)));
}

TEST(Panoptic, PointsAndSegmentsAreReadWhereAskedFor) {
  const TemporaryFolder folder;
  make_panoptic(folder);
  write_npz(folder.file("init_pt_cld.npz"),
            {{"data", {{1, 7}, std::vector<double>{1, 2, 3, 0, 0.5, 1, 1}}}});
  SceneOptions options;
  options.masks = Masks::ignore;
  EXPECT_FALSE(read_scene(folder.path(), options).train[0].mask_path.empty());
  EXPECT_FALSE(read_scene(folder.path(), options).has_alpha);
  options.masks = Masks::foreground;
  EXPECT_FALSE(read_scene(folder.path(), options).train[0].mask_path.empty());
  EXPECT_FALSE(read_scene(folder.path(), options).has_alpha);
  options.masks = Masks::alpha;
  const Scene scene = read_scene(folder.path(), options);
  EXPECT_EQ(scene.points.xyz, (std::vector<double>{1, 2, 3}));
  EXPECT_EQ(scene.points.rgb, (std::vector<uint8_t>{0, 128, 255}));
  write_npz(folder.file("init_pt_cld.npz"),
            {{"data", {{1, 6}, std::vector<float>{1, 2, 3, 0, 0.5, 1}}}});
  EXPECT_EQ(read_scene(folder.path()).points.rgb, scene.points.rgb);
  write_npz(folder.file("init_pt_cld.npz"),
            {{"data", {{1, 6}, std::vector<float>{1, 2, 3, 0, 128, 255}}}});
  EXPECT_EQ(read_scene(folder.path()).points.rgb, scene.points.rgb);
  EXPECT_TRUE(scene.has_alpha);
  EXPECT_EQ(scene.train[4].mask_path, folder.file("seg/3/000001.png"));
  std::filesystem::remove(folder.file("seg/3/000001.png"));
  expect_error([&] { read_scene(folder.path(), options); },
               {"train_meta.json", "3/000001.jpg", "no mask", "scene.masks = foreground"});
}

TEST(Panoptic, FilesThatContradictThemselvesAreRefused) {
  const TemporaryFolder folder;
  make_panoptic(folder);
  const auto read = [&] { read_scene(folder.path()); };
  replace(folder, "[[1,0,0,1]", "[[NaN,0,0,1]");
  expect_error(read, {"train_meta.json", "4x4 matrix of finite numbers"});
  replace(folder, "[[1,0,0,1]", "[[null,0,0,1]");
  expect_error(read, {"'w2c' of camera 0 at time 0", "train_meta.json", "finite numbers"});
  replace(folder, "[[1,0,0,1]", "[[2,0,0,1]");
  expect_error(read, {"'w2c' of camera 0 at time 0", "not a rotation"});
  replace(folder, "[[10, 0, 4.5]", "[[10, 4.5]");
  expect_error(read, {"'k' of camera 0 at time 0", "3x3 matrix"});
  replace(folder, "[\"1/000000.jpg\", ", "[");
  expect_error(read, {"train_meta.json", "another number of cameras", "time 0"});
  replace(folder, "\"cam_id\": [[1, 3], ", "\"cam_id\": [");
  expect_error(read, {"'cam_id'", "3 times"});
  for (const char* id : {"1.5", "-1", "4294967297", "18446744073709551615", "null"}) {
    replace(folder, "\"cam_id\": [[1, ", fmt::format("\"cam_id\": [[{}, ", id));
    expect_error(read, {"'cam_id'", "camera 0 at time 0", "not an integer from 0 to 1000000"});
  }
  replace(folder, "\"cam_id\": [[1, 3]", "\"cam_id\": [[3, 3]");
  expect_error(read, {"'cam_id' of camera 1 at time 0", "is 3, which another camera has"});
  replace(folder, "1/000000.jpg", "3/000000.jpg");
  expect_error(
      read, {"camera 1 at time 0", "'3/000000.jpg', which is already that of camera 0 at time 0"});
  for (const auto& [what, by] : {std::pair("[[10, 0, 4.5]", "[[10, 0.1, 4.5]"),
                                 {"[0, 11, 3.5]", "[1, 11, 3.5]"},
                                 {"3.5], [0, 0, 1]]", "3.5], [0, 0, 2]]"}}) {
    replace(folder, what, by);
    expect_error(read, {"'k' of camera 0 at time 0", "train_meta.json", "skew are not supported"});
  }
  for (const char* fn : {"null", "\"x\"", "0", "{}"}) {
    const std::string text = meta(3, {1, 3});
    const size_t at = text.find("\"fn\": ") + 6, end = text.find(", \"cam_id\"");
    folder.write("train_meta.json", std::string(text).replace(at, end - at, fn));
    expect_error(read, {"'fn' of", "not a list of times"});
  }
  replace(folder, "\"fn\": [", "\"fn\": [null, ");
  expect_error(read, {"'fn' of", "no list of cameras at time 0"});
  replace(folder, "\"w\": 8", "\"w\": 9");
  expect_error(read, {"8x6", "9x6"});
  replace(folder, "\"w\": 8, ", "");
  expect_error(read, {"train_meta.json", "no 'w'"});
  replace(folder, "1/000000.jpg", "1/none.jpg");
  expect_error(read, {"1/none.jpg", "there is no"});
  replace(folder, "1/000000.jpg", "../../000000.jpg");
  expect_error(read, {"relative path"});
  folder.write("train_meta.json", meta(3, {1, 3}).substr(0, 200));
  expect_error(read, {"train_meta.json", "not valid JSON"});
  folder.write("train_meta.json", meta(2, {1, 3}));
  expect_error(read, {"test_meta.json", "more times than the 2 of"});
  folder.write("train_meta.json", meta(0, {}));
  expect_error(read, {"train_meta.json", "no images"});
  make_panoptic(folder);
  write_npz(folder.file("init_pt_cld.npz"), {{"data", {{1, 3}, std::vector<double>{1, 2, 3}}}});
  expect_error(read, {"init_pt_cld.npz", "(1, 3)"});
  for (const double far : {1e20, 1e300, double(INFINITY), double(NAN)}) {
    write_npz(folder.file("init_pt_cld.npz"),
              {{"data", {{1, 6}, std::vector<double>{1, 2, far, 0, 0, 0}}}});
    expect_error(read, {"point 0 of", "init_pt_cld.npz", "NaN, Inf or beyond 1e+18"});
  }
  write_npz(folder.file("init_pt_cld.npz"), {{"data", {{1, 6}, std::vector<uint8_t>(6)}}});
  expect_error(read, {"init_pt_cld.npz", "expected floats"});
}

TEST(Panoptic, PointsTakeLittleMoreMemoryThanTheirFile) {
  const TemporaryFolder folder;
  make_panoptic(folder);
  constexpr size_t n = 1000000;
  std::vector<float> values(7 * n);
  for (size_t i = 0; i < values.size(); ++i) values[i] = float(i % 1009);
  const std::string path = folder.file("init_pt_cld.npz");
  write_npz(path, {{"data", {{n, 7}, values}}}, Packing::stored);
  constexpr double mib = 1 << 20;
  const double file = double(std::filesystem::file_size(path)) / mib;
  EXPECT_LT(memory_of_first([&] { EXPECT_EQ(read_scene(folder.path()).points.size(), n); }),
            2.2 * file);
}
