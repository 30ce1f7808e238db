// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/depth_map.hpp"

#include <filesystem>

#include "optim/formats/npy.hpp"
#include "optim/images/image.hpp"
#include "optim/scene/lens.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

namespace fs = std::filesystem;

Frame with_depth(const std::string& path) {
  Frame frame;
  frame.name = "cam00_0000";
  frame.depth_path = path;
  return frame;
}

Camera camera_of(int width, int height) {
  Camera camera;
  camera.width = width, camera.height = height;
  camera.fx = camera.fy = width;
  camera.cx = 0.5 * width, camera.cy = 0.5 * height;
  return camera;
}

std::vector<float> read(const std::string& path, int width, int height,
                        const SceneOptions& options = {}) {
  return read_depth_map(with_depth(path), camera_of(width, height), width, height, options);
}

TEST(DepthMap, IsThatOfTheFileOrItsNearestSample) {
  const TemporaryFolder folder;
  const std::string path = folder.file("0000.npy"), one = folder.file("one.npy");
  std::vector<float> values;
  for (int i = 0; i < 24; ++i) values.push_back(float(i));
  write_npy(path, {{4, 6}, values});
  write_npy(one, {{1, 4, 6}, values});
  EXPECT_EQ(read(path, 6, 4), values);
  EXPECT_EQ(read(one, 6, 4), values);
  // The centre of a pixel twice as large is between four pixels; the last of these is used.
  EXPECT_EQ(read(path, 3, 2), (std::vector<float>{7, 9, 11, 19, 21, 23}));
}

TEST(DepthMap, OfAPngHasUnitsIfMetric) {
  const TemporaryFolder folder;
  const std::string path = folder.file("0000.png");
  write_png16(path, 2, 1, {1500, 0});
  EXPECT_EQ(read(path, 2, 1), (std::vector<float>{1500 * 0.001f, 0}));
  SceneOptions options;
  options.depth_unit = 0.01f;
  EXPECT_EQ(read(path, 2, 1, options), (std::vector<float>{1500 * 0.01f, 0}));
  options.depth = DepthFiles::disparity;
  EXPECT_EQ(read(path, 2, 1, options), (std::vector<float>{1500, 0}));
  const std::string integers = folder.file("integers.npy");
  write_npy(integers, {{1, 2}, std::vector<uint16_t>{1500, 0}});
  EXPECT_EQ(read(integers, 2, 1), (std::vector<float>{1500 * 0.001f, 0}));
  const std::string colours = folder.file("colours.png");
  write_png(colours, {2, 1, 3, {1, 2, 3, 4, 5, 6}});
  expect_error([&] { read(colours, 2, 1); }, {colours, "grey"});
}

// The file shows what the stored image shows; the depth is that of the pinhole image.
TEST(DepthMap, IsUndistortedWithItsImage) {
  const TemporaryFolder folder;
  const std::string path = folder.file("0000.npy");
  constexpr int width = 80, height = 60;
  const Camera camera = pinhole_of_lens(camera_of(width, height), Lens::Kind::radial,
                                        {0.2, 0.05, 0, 0, 0, 0, 0, 0}, "camera");
  std::vector<float> columns;  // each pixel has the number of its column
  for (int i = 0; i < width * height; ++i) columns.push_back(float(i % width + 1));
  write_npy(path, {{height, width}, columns});
  const std::vector<float> depth =
      read_depth_map(with_depth(path), camera, width, height, SceneOptions{});
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) {
      const double at = stored_at(camera, x + 0.5, y + 0.5).x();
      EXPECT_EQ(depth[size_t(y * width + x)], float(int(at) + 1));
    }
}

TEST(DepthMap, OfAnotherShapeIsRefused) {
  const TemporaryFolder folder;
  const std::string path = folder.file("0000.npy"), flat = folder.file("flat.npy");
  write_npy(path, {{4, 6}, std::vector<float>(24, 1.f)});
  write_npy(flat, {{24}, std::vector<float>(24, 1.f)});
  expect_error([&] { read(path, 6, 6); }, {path, "6x4", "6x6"});
  expect_error([&] { read(flat, 6, 4); }, {flat, "(24,)", "(height, width)"});
  expect_error([&] { read("", 6, 4); }, {"cam00_0000", "no depth file"});
  expect_error([&] { read("no/such.npy", 6, 4); }, {"no/such.npy"});
}

TEST(DepthMap, IsFoundByTheNameOfTheImage) {
  const TemporaryFolder folder;
  Scene scene;
  scene.folder = folder.path();
  for (const char* image : {"ims/1/000.jpg", "images/b.png", "c.png", "images/d.png"}) {
    Frame frame;
    frame.path = folder.file(image);
    scene.train.push_back(frame);
  }
  find_depth_files(scene);
  EXPECT_EQ(scene.train[0].depth_path, "");
  for (const char* depth : {"1/000.npy", "images/b.png", "c.npy", "c.png"}) {
    fs::create_directories(fs::path(folder.file("depth")) / fs::path(depth).parent_path());
    folder.write(std::string("depth/") + depth, "");
  }
  scene.test.push_back(scene.train[2]);
  scene.test[0].depth_path = "given";
  find_depth_files(scene);
  EXPECT_EQ(scene.train[0].depth_path, folder.file("depth/1/000.npy"));
  EXPECT_EQ(scene.train[1].depth_path, folder.file("depth/images/b.png"));
  EXPECT_EQ(scene.train[2].depth_path, folder.file("depth/c.npy"));
  EXPECT_EQ(scene.train[3].depth_path, "");
  EXPECT_EQ(scene.test[0].depth_path, "given");
}

}  // namespace
}  // namespace gflow
