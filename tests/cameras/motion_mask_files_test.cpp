// SPDX-License-Identifier: Apache-2.0
#include "optim/cameras/motion_mask_files.hpp"

#include <gtest/gtest.h>

#include <filesystem>

#include "tests/support/room_video.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

constexpr double kK1 = 0.2;
constexpr size_t kWithoutPose = 5;

const RoomVideo& filmed_room() {
  static const RoomVideo room({0.06, 0.02, 0.03});
  return room;
}

CameraPath path_of_room(double k1) {
  CameraPath path;
  path.lens.focal = RoomVideo::focal;
  path.lens.k1 = k1;
  path.lens.centre = {RoomVideo::width / 2., RoomVideo::height / 2.};
  for (const Camera& camera : filmed_room().video.cameras)
    path.poses.emplace_back(Eigen::Isometry3d(camera.viewmat));
  path.poses[kWithoutPose].reset();
  return path;
}

// As a lens with k1 shows an image.
Image through(const SharedLens& lens, const Image& image) {
  std::vector<float> from;
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) {
      const Eigen::Vector2d ray = lens.unproject({x + 0.5, y + 0.5}).head<2>();
      from.push_back(float(lens.centre.x() + lens.focal * ray.x()));
      from.push_back(float(lens.centre.y() + lens.focal * ray.y()));
    }
  return remapped(image, image.width, image.height, from);
}

LoadedScene video_through(const SharedLens& lens) {
  Scene scene;
  scene.cameras = {filmed_room().video.cameras[0]};  // like that of a video, unknown
  for (Frame frame : filmed_room().all) {
    frame.image = std::make_shared<const Image>(through(lens, *frame.image));
    frame.camera = 0;
    scene.train.push_back(frame);
  }
  complete_scene(scene);
  return with_frames(std::move(scene), {}, "");
}

TEST(MotionMaskFiles, AreBlackWhereImagesOfALensMove) {
  for (const double k1 : {0., kK1}) {
    const CameraPath path = path_of_room(k1);
    const TemporaryFolder folder;
    const double moving =
        write_motion_mask_files(folder.path() + "/masks", video_through(path.lens), path, {});
    size_t files = 0;
    for (const auto& entry : std::filesystem::directory_iterator(folder.path() + "/masks"))
      files += entry.is_regular_file();
    EXPECT_EQ(files, size_t(RoomVideo::frames - 1));
    std::vector<Mask> found, truth;
    size_t black = 0;
    for (size_t k = 0; k < size_t(RoomVideo::frames); ++k) {
      const std::string file = fmt::format("{}/masks/{:05}.png", folder.path(), k);
      ASSERT_EQ(std::filesystem::exists(file), k != kWithoutPose);
      if (k == kWithoutPose) continue;
      const Image image = read_grey(file);
      Image board{RoomVideo::width, RoomVideo::height, 1, filmed_room().moving[k].pixels};
      for (uint8_t& pixel : board.pixels) pixel = pixel ? 255 : 0;
      board = through(path.lens, board);
      ASSERT_EQ(image.width, board.width);
      ASSERT_EQ(image.height, board.height);
      found.emplace_back(image.width, image.height);
      truth.emplace_back(image.width, image.height);
      for (size_t i = 0; i < image.pixels.size(); ++i) {
        EXPECT_TRUE(image.pixels[i] == 0 || image.pixels[i] == 255);
        found.back().pixels[i] = image.pixels[i] == 0;
        truth.back().pixels[i] = board.pixels[i] > 127;
        black += image.pixels[i] == 0;
      }
    }
    EXPECT_GT(overlap(found, truth), 0.55) << "k1 " << k1;
    const double pixels = (RoomVideo::frames - 1) * RoomVideo::width * RoomVideo::height;
    EXPECT_NEAR(moving, double(black) / pixels, 1e-9);
  }
}

}  // namespace
}  // namespace gflow
