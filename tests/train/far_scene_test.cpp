// SPDX-License-Identifier: Apache-2.0
// A scene a million metres from the origin of its world, as in surveys: it is read, trained,
// rendered and exported like the same scene at the origin.
#include "apps/stress/training/far_scene.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "optim/model/slice.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

constexpr Place kAway = {431250.37, -5811000.25, 1e6};

class FarSceneTest : public ::testing::Test {
 protected:
  FarSceneTest()
      : queue(test_queue()), near(queue), far(near, kAway), config(small_config(near, 60)) {
    config.density.enabled = false;
    far_config = config;
    far_config.scene.path = far.path();
  }
  Queue queue;
  SmallScene near;
  FarScene far;
  TrainOptions config, far_config;
};

TEST_F(FarSceneTest, IsReadRelativeToAPlaceInItsMidst) {
  const Scene here = load_scene(config.scene, "").scene;
  const Scene there = load_scene(far_config.scene, "").scene;
  EXPECT_EQ(here.origin, (std::array<double, 3>{0, 0, 0}));
  EXPECT_NEAR(there.extent, here.extent, 1e-8);
  ASSERT_EQ(there.points.size(), here.points.size());
  for (size_t c = 0; c < here.cameras.size(); ++c)
    for (size_t i = 0; i < here.points.size(); ++i) {
      const auto seen = [&](const Scene& scene) {
        // As the device stores it.
        const Eigen::Vector3f p =
            Eigen::Map<const Eigen::Vector3d>(&scene.points.xyz[3 * i]).cast<float>();
        return scene.cameras[c].project(p.cast<double>());
      };
      EXPECT_LE((seen(here) - seen(there)).norm(), 1e-3);  // [px] as T28 of gflow stress
    }
}

// Without points only the cameras give its location.
TEST_F(FarSceneTest, WithoutPointsItIsReadAndTrainedAsNearby) {
  const FarScene bare(near, {0, 0, 0}, false), far_bare(near, kAway, false);
  config.scene.path = bare.path();
  far_config.scene.path = far_bare.path();
  config.init.from = far_config.init.from = InitFrom::random;
  const Scene here = load_scene(config.scene, "").scene;
  const Scene there = load_scene(far_config.scene, "").scene;
  EXPECT_EQ(here.origin, (std::array<double, 3>{0, 0, 0}));
  EXPECT_NEAR(there.extent, here.extent, 1e-8);
  const Eigen::Vector3d away(kAway.data()), origin(there.origin.data());
  EXPECT_LE((focus_point(there) + origin - focus_point(here) - away).norm(), 1e-7);
  for (size_t c = 0; c < here.cameras.size(); ++c) {
    const Eigen::Vector3d position = there.cameras[c].position();
    EXPECT_LE(position.norm(), 100 * here.extent);
    EXPECT_LE((position + origin - here.cameras[c].position() - away).norm(), 1e-8);
  }
  SmallTraining nearby(queue, config), afar(queue, far_config);
  nearby.steps(queue, 30);
  afar.steps(queue, 30);
  // The same random points except for their last bits, and the effect of 30 training steps on
  // these.
  EXPECT_NEAR(afar.trainer.report(queue).value("psnr"), nearby.trainer.report(queue).value("psnr"),
              0.1);
}

TEST_F(FarSceneTest, IsTrainedDrawnAndExportedInItsWorld) {
  SmallTraining here(queue, config), there(queue, far_config);
  const std::array<double, 3> origin = there.model.shape.origin;
  here.steps(queue, 30);
  there.steps(queue, 30);
  EXPECT_NEAR(there.trainer.report(queue).value("psnr"), here.trainer.report(queue).value("psnr"),
              0.01);
  const std::vector<float> a = here.model.parameters["means"].values.read(queue);
  const std::vector<float> b = there.model.parameters["means"].values.read(queue);
  ASSERT_EQ(a.size(), b.size());
  for (size_t i = 0; i < a.size(); ++i)
    EXPECT_NEAR(double(b[i]) + origin[i % 3], double(a[i]) + kAway[i % 3], 2e-4);

  const TemporaryFolder folder;
  write_model(folder.file("model.ply"), there.model.read(queue));
  const HostModel kept = read_model(folder.file("model.ply"));
  EXPECT_EQ(kept.shape.origin, origin);
  EXPECT_EQ(kept.groups.at("means"), b);

  // For other programs: in world coordinates, to 1e-9 of their size (T28 of gflow stress).
  const PlyTable slice_now = slice(queue, there.model, 0.5).table;
  write_ply(folder.file("now.ply"), slice_now);
  const PointCloud now = read_point_cloud(folder.file("now.ply"));
  const char* const axes[] = {"x", "y", "z"};
  for (size_t axis = 0; axis < 3; ++axis) {
    const std::vector<float> local = slice_now.column_values(axes[axis]);
    for (size_t i = 0; i < now.size(); ++i)
      EXPECT_NEAR(now.xyz[3 * i + axis], double(local[i]) + origin[axis],
                  1e-9 * std::fabs(origin[axis]));
  }

  // A training may start from such a file.
  far_config.init.from = InitFrom::file;
  far_config.init.file = folder.file("now.ply");
  const std::vector<float> first =
      SmallTraining(queue, far_config).model.parameters["means"].values.read(queue);
  ASSERT_EQ(first.size(), now.xyz.size());
  for (size_t axis = 0; axis < 3; ++axis) {
    const std::vector<float> local = slice_now.column_values(axes[axis]);
    for (size_t i = 0; i < now.size(); ++i) EXPECT_NEAR(first[3 * i + axis], local[i], 1e-5);
  }
}

// A model with one origin, rendered with cameras of a scene that chose another.
TEST_F(FarSceneTest, TakesThePlaceOfTheModelItIsLookedAtWith) {
  const std::array<double, 3> given = {kAway[0] + 3, kAway[1] - 1, kAway[2]};
  const Scene scene = load_scene(far_config.scene, "", given).scene;
  const Scene own = load_scene(far_config.scene, "").scene;
  EXPECT_EQ(scene.origin, given);
  for (size_t axis = 0; axis < 3; ++axis)
    EXPECT_NEAR(scene.cameras[1].position()[long(axis)] + given[axis],
                own.cameras[1].position()[long(axis)] + own.origin[axis], 1e-8);
}

}  // namespace
}  // namespace gflow
