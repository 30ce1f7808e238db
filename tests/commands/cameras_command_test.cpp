// SPDX-License-Identifier: Apache-2.0
// `gflow cameras` on rendered videos whose cameras are known.
#include <gtest/gtest.h>

#include "optim/scene/readers/colmap_model.hpp"
#include "optim/scene/scene.hpp"
#include "tests/support/camera_path.hpp"
#include "tests/support/command.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

constexpr int kFilmed = 16, kFilmWidth = 200, kFilmHeight = 150;
constexpr double kFilmFocal = 190;

// A film along the arc, as a folder of numbered images.
class CamerasCommand : public testing::Test {
 protected:
  std::string film(const std::string& name, int frames = kFilmed) {
    for (int k = 0; k < frames; ++k)
      write_png(folder_.file(fmt::format("{}/{}.png", name, k)), seen_from(k));
    return folder_.path() + "/" + name;
  }
  static Image seen_from(int k) {
    return image_of_room(pose_on_arc(k, kFilmed), kFilmFocal, kFilmWidth, kFilmHeight);
  }
  std::string path(const std::string& name) const { return folder_.path() + "/" + name; }
  const TemporaryFolder& folder() const { return folder_; }

 private:
  TemporaryFolder folder_;
};

TEST_F(CamerasCommand, WritesASceneWhoseCamerasAreThoseOfTheFilm) {
  const Outcome result = gflow({"cameras", film("film"), "-o", path("scene"), "--quiet"});
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_NE(result.out.find("16 of 16 placed"), std::string::npos) << result.out;

  SceneOptions options;
  options.test_every = 0;
  const Scene scene = read_scene(path("scene"), options);
  EXPECT_EQ(scene.layout, "nerfstudio");
  ASSERT_EQ(scene.train.size(), size_t(kFilmed));
  EXPECT_EQ(scene.steps, kFilmed);
  EXPECT_GT(scene.points.size(), 100u);
  std::vector<Eigen::Isometry3d> found, truth;
  for (int k = 0; k < kFilmed; ++k) {
    const Camera& camera = scene.cameras[size_t(scene.train[size_t(k)].camera)];
    EXPECT_NEAR(camera.fx, kFilmFocal, 0.02 * kFilmFocal);
    EXPECT_NEAR(scene.train[size_t(k)].time, k / (kFilmed - 1.), 1e-9);
    found.emplace_back(camera.viewmat);
    truth.push_back(pose_on_arc(k, kFilmed));
  }
  const PoseErrors errors = compare_poses(found, truth);
  EXPECT_LT(errors.place, 0.01);
  EXPECT_LT(errors.angle, 0.3);

  const ColmapModel model = read_colmap_model(path("scene") + "/sparse/0");
  ASSERT_EQ(model.images.size(), size_t(kFilmed));
  EXPECT_EQ(model.points.size(), scene.points.size());
  for (int k = 0; k < kFilmed; ++k)
    EXPECT_LT((model.images[size_t(k)].camera.viewmat - found[size_t(k)].matrix()).norm(), 1e-6);
}

TEST_F(CamerasCommand, ACameraThatStandsStillIsToldAndNothingIsWritten) {
  for (int k = 0; k < 5; ++k)
    write_png(folder().file(fmt::format("still/{}.png", k)), seen_from(3));
  const Outcome result = gflow({"cameras", path("still"), "-o", path("scene"), "--quiet"});
  EXPECT_EQ(result.code, 1);
  EXPECT_NE(result.err.find("does not move"), std::string::npos) << result.err;
  EXPECT_FALSE(std::filesystem::exists(path("scene")));
}

// Six frames upside down follow.
TEST_F(CamerasCommand, FramesAfterACutAreNamedAndLeftOut) {
  const std::string film_folder = film("film");
  for (int k = 0; k < 6; ++k) {
    Image turned = seen_from(k);
    std::reverse(turned.pixels.begin(), turned.pixels.end());
    write_png(fmt::format("{}/{}.png", film_folder, kFilmed + k), turned);
  }
  const Outcome result = gflow({"cameras", film_folder, "-o", path("scene"), "--quiet"});
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_NE(result.out.find("16 of 22 placed"), std::string::npos) << result.out;
  EXPECT_NE(result.err.find("frames 16 to 21"), std::string::npos) << result.err;
  EXPECT_NE(result.err.find("between frames 15 and 16"), std::string::npos) << result.err;
  EXPECT_EQ(read_colmap_model(path("scene") + "/sparse/0").images.size(), size_t(kFilmed));
}

TEST_F(CamerasCommand, TrainingTellsOfACameraThatMoves) {
  const auto errors_of = [&](const std::string& film_folder) {
    const Outcome result = gflow({"train", film_folder, "-o", film_folder + "_run", "--iterations",
                                  "1", "--quiet", "--set", "flow.enabled=false"});
    EXPECT_EQ(result.code, 0) << result.err;
    return result.err;
  };
  EXPECT_NE(errors_of(film("film", 6)).find("the camera seems to move"), std::string::npos);
  for (int k = 0; k < 6; ++k)
    write_png(folder().file(fmt::format("still/{}.png", k)), seen_from(3));
  EXPECT_EQ(errors_of(path("still")).find("the camera seems to move"), std::string::npos);
}

TEST_F(CamerasCommand, TwoFramesAreTooFew) {
  const Outcome result = gflow({"cameras", film("film", 2), "-o", path("scene"), "--quiet"});
  EXPECT_EQ(result.code, 1);
  EXPECT_NE(result.err.find("has 2 frames, at least 3"), std::string::npos) << result.err;
  EXPECT_NE(result.err.find("film"), std::string::npos) << result.err;
}

TEST_F(CamerasCommand, AFolderWithFilesStaysAsItIs) {
  const std::string film_folder = film("film", 3);
  const Outcome result = gflow({"cameras", film_folder, "-o", film_folder, "--quiet"});
  EXPECT_EQ(result.code, 1);
  EXPECT_NE(result.err.find("not empty"), std::string::npos) << result.err;
  EXPECT_FALSE(fs::exists(film_folder + "/transforms.json"));
}

TEST_F(CamerasCommand, ASceneThatHasCamerasIsRefused) {
  folder().write("scene/transforms.json", "{}");
  const Outcome again = gflow({"cameras", path("scene"), "-o", path("other"), "--quiet"});
  EXPECT_EQ(again.code, 1);
  EXPECT_NE(again.err.find("has cameras"), std::string::npos) << again.err;
}

}  // namespace
}  // namespace gflow
