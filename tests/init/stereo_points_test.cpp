// SPDX-License-Identifier: Apache-2.0
#include "optim/init/stereo_points.hpp"

#include <cmath>

#include "optim/images/image.hpp"
#include "optim/train/preparation.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

constexpr double kWall = 1;  // its z; cameras are at z = -3

// Four cameras in front of a painted wall, one time step, no points.
class PaintedWall {
 public:
  PaintedWall() {
    std::vector<double> rows;
    for (int c = 0; c < 4; ++c) {
      const Camera camera = small_camera(c, 160, 128);
      const std::string name = fmt::format("cam{:02}/images/0000.png", c);
      std::filesystem::create_directories(std::filesystem::path(folder_.file(name)).parent_path());
      write_png(folder_.file(name), image_of(camera));
      const Eigen::Matrix3d world = camera.viewmat.topLeftCorner<3, 3>().transpose();
      const Eigen::Vector3d p = camera.position();
      const double size[3] = {128, 160, camera.fx};
      for (int r = 0; r < 3; ++r)  // down, right, backwards, position, size
        rows.insert(rows.end(), {world(r, 1), world(r, 0), -world(r, 2), p[r], size[r]});
      rows.insert(rows.end(), {1, 10});  // depths
    }
    write_npy(folder_.file("poses_bounds.npy"), {{4, 17}, rows});
    config.scene.path = folder_.path();
    loaded = load_scene(config.scene, "");
  }

  PointCloud found(uint32_t seed = 1) {
    return stereo_points(loaded.scene, *loaded.frames, {}, 200, seed);
  }

  TrainOptions config;
  LoadedScene loaded;

 private:
  static Image image_of(const Camera& camera) {
    Image image{camera.width, camera.height, 3, {}};
    const Eigen::Matrix3d turn = camera.viewmat.topLeftCorner<3, 3>().transpose();
    for (int y = 0; y < camera.height; ++y)
      for (int x = 0; x < camera.width; ++x) {
        const Eigen::Vector3d ray = turn * Eigen::Vector3d((x + 0.5 - camera.cx) / camera.fx,
                                                           (y + 0.5 - camera.cy) / camera.fy, 1);
        const Eigen::Vector3d p =
            camera.position() + ray * ((kWall - camera.position().z()) / ray.z());
        for (const double k : {3.1, 4.3, 5.7})
          image.pixels.push_back(uint8_t(128 + 60 * std::sin(k * p.x() + 2 * p.y()) +
                                         60 * std::cos(p.x() - k * k * p.y())));
      }
    return image;
  }
  TemporaryFolder folder_;
};

// One pixel of disparity is one part in 30 of the depth here, 0.13: allows about one pixel.
double share_on_wall(const PointCloud& points) {
  size_t near = 0;
  for (size_t i = 0; i < points.size(); ++i)
    near += std::fabs(double(points.xyz[3 * i + 2]) - kWall) < 0.15;
  return double(near) / double(points.size());
}

TEST(StereoPoints, LieWhereTheCamerasAgree) {
  PaintedWall wall;
  ASSERT_EQ(wall.loaded.scene.points.size(), 0u);
  EXPECT_EQ(wall.loaded.scene.near, 1);
  EXPECT_EQ(wall.loaded.scene.far, 10);
  const PointCloud points = wall.found();
  EXPECT_EQ(points.size(), 200u);
  EXPECT_EQ(points.rgb.size(), points.xyz.size());
  EXPECT_GT(share_on_wall(points), 0.9);
  wall.loaded.scene.near = wall.loaded.scene.far = 0;  // depth range from the camera axes
  EXPECT_GT(share_on_wall(wall.found()), 0.9);
}

TEST(StereoPoints, AreAFunctionOfTheSeedAndNeedTwoCameras) {
  PaintedWall wall;
  EXPECT_EQ(wall.found(1).xyz, wall.found(1).xyz);
  EXPECT_NE(wall.found(1).xyz, wall.found(2).xyz);
  wall.loaded.scene.train.resize(1);
  EXPECT_EQ(wall.found().size(), 0u);
}

TEST(StereoPoints, AreWhereASceneWithoutPointsBegins) {
  Queue queue = test_queue();
  PaintedWall wall;
  wall.config.init.count = 150;
  Preparation prepared(wall.config, "");
  prepared.find_motion_masks();
  const HostModel model = prepared.first_model(queue);
  ASSERT_EQ(model.count, 150u);
  const std::vector<float>& means = model.groups.at("means");
  PointCloud first;
  first.xyz.assign(means.begin(), means.end());
  EXPECT_GT(share_on_wall(first), 0.9);
}

TEST(StereoPoints, AreRefusedWhereTooFewAgree) {
  Queue queue = test_queue();
  PaintedWall wall;
  wall.config.init.from = InitFrom::stereo;
  wall.config.init.count = 20;  // fewer than the minimum for a scene
  Preparation prepared(wall.config, "");
  expect_error([&] { prepared.first_model(queue); }, {"stereo", "20 points", "random"});
}

}  // namespace
}  // namespace gflow
