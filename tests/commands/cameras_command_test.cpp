// SPDX-License-Identifier: Apache-2.0
// `gflow cameras` on rendered videos whose cameras are known.
#include <gtest/gtest.h>

#include "optim/cameras/find_cameras.hpp"
#include "optim/runs/run_folder.hpp"
#include "optim/scene/json_file.hpp"
#include "optim/scene/readers/colmap_model.hpp"
#include "optim/scene/scene.hpp"
#include "shared/random.h"
#include "tests/support/camera_path.hpp"
#include "tests/support/command.hpp"
#include "tests/support/room_video.hpp"
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
    static std::map<int, Image> drawn;  // drawing takes long
    Image& image = drawn[k];
    if (image.width == 0)
      image = image_of_room(pose_on_arc(k, kFilmed), kFilmFocal, kFilmWidth, kFilmHeight);
    return image;
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
  EXPECT_EQ(result.err.find("focal"), std::string::npos) << result.err;
  const Json statistics = read_json(path("scene") + "/statistics.json");
  EXPECT_EQ(statistics["placed"], 16);
  EXPECT_EQ(statistics["focal_is_certain"], true);
  EXPECT_LT(statistics["reprojection_median"], 0.5);

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

TEST_F(CamerasCommand, WritesMasksOfWhatMovesThatNoReaderTakesForItsOwn) {
  std::vector<Mask> truth;
  for (int k = 0; k < kFilmed; ++k) {
    RoomTruth seen;
    write_png(folder().file(fmt::format("lively/{}.png", k)),
              image_of_room(pose_on_arc(k + 16, 48), kFilmFocal, kFilmWidth, kFilmHeight,
                            k * Eigen::Vector3d(0.06, 0.02, 0.03), &seen));
    truth.emplace_back(kFilmWidth, kFilmHeight);
    truth.back().pixels = seen.last;
  }
  const Outcome result = gflow({"cameras", path("lively"), "-o", path("scene"), "--quiet"});
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_NE(result.out.find("% of the images\n"), std::string::npos) << result.out;
  std::vector<Mask> found;
  for (int k = 0; k < kFilmed; ++k) {
    const Image mask = read_grey(fmt::format("{}/motion_masks/{:05}.png", path("scene"), k));
    found.emplace_back(mask.width, mask.height);
    for (size_t i = 0; i < mask.pixels.size(); ++i) found.back().pixels[i] = mask.pixels[i] == 0;
  }
  EXPECT_GT(overlap(found, truth), 0.5);

  for (const char* layout : {"nerfstudio", "colmap"}) {
    const Scene scene = read_scene(path("scene"), {});
    EXPECT_EQ(scene.layout, layout);
    for (const Frame& frame : scene.train) EXPECT_EQ(frame.mask_path, "");
    for (const std::string& notice : scene.notices)
      EXPECT_EQ(notice.find("mask"), std::string::npos) << notice;
    fs::remove(path("scene/transforms.json"));
  }
}

std::map<std::string, std::string> files_below(const std::string& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file())
      files[fs::relative(entry.path(), folder).string()] = contents(entry.path().string());
  return files;
}

TEST_F(CamerasCommand, ContinuesFromTheTracksOfASearchThatWasStopped) {
  const std::string film_folder = film("film");
  ASSERT_EQ(gflow({"cameras", film_folder, "-o", path("whole"), "--quiet"}).code, 0);
  const Command stopped({"cameras", film_folder, "-o", path("scene"), "--quiet"});
  ASSERT_TRUE(wait_until([&] { return fs::exists(path("scene/tracks.npz")); }));
  stopped.send(SIGKILL);
  stopped.wait();
  ASSERT_TRUE(is_unfinished_scene(path("scene")));

  const Outcome result = gflow({"cameras", film_folder, "-o", path("scene")});
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_NE(result.err.find("continuing from the tracks of 16 of 16 frames"), std::string::npos)
      << result.err;
  EXPECT_EQ(files_below(path("scene")), files_below(path("whole")));
}

TEST_F(CamerasCommand, ACameraThatStandsStillIsToldAndNothingIsWritten) {
  for (int k = 0; k < 5; ++k)
    write_png(folder().file(fmt::format("still/{}.png", k)), seen_from(3));
  const Outcome result = gflow({"cameras", path("still"), "-o", path("scene"), "--quiet"});
  EXPECT_EQ(result.code, 1);
  EXPECT_NE(result.err.find("does not move"), std::string::npos) << result.err;
  EXPECT_FALSE(std::filesystem::exists(path("scene")));
}

TEST_F(CamerasCommand, SaysWhenTheFocalLengthIsNotCertain) {
  const Eigen::Isometry3d middle = pose_on_arc(8, kFilmed);
  for (int k = 0; k < 8; ++k)  // to the side, without turning
    write_png(folder().file(fmt::format("side/{}.png", k)),
              image_of_room(Eigen::Translation3d(0.15 * k - 0.5, 0, 0) * middle, kFilmFocal,
                            kFilmWidth, kFilmHeight));
  const Outcome free = gflow({"cameras", path("side"), "-o", path("free"), "--quiet"});
  ASSERT_EQ(free.code, 0) << free.err;
  EXPECT_NE(free.err.find("--fovy"), std::string::npos) << free.err;
  EXPECT_EQ(read_json(path("free") + "/statistics.json")["focal_is_certain"], false);
  const Outcome given =
      gflow({"cameras", path("side"), "-o", path("given"), "--fovy", "43", "--quiet"});
  ASSERT_EQ(given.code, 0) << given.err;
  EXPECT_EQ(given.err.find("--fovy"), std::string::npos) << given.err;
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
  EXPECT_NE(result.err.find("between frames 15 and 16, as at a cut"), std::string::npos)
      << result.err;
  EXPECT_EQ(read_colmap_model(path("scene") + "/sparse/0").images.size(), size_t(kFilmed));
}

class TrainingOfVideo : public CamerasCommand {
 protected:
  Outcome train(const std::string& scene, const std::string& run,
                const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"train",
                                       scene,
                                       "-o",
                                       path(run),
                                       "--iterations",
                                       "2",
                                       "--quiet",
                                       "--set",
                                       "flow.enabled=false",
                                       "--set",
                                       "init.background=30",
                                       "--set",
                                       "init.dynamic=20"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return gflow(arguments);
  }
  std::string scene_of(const std::string& run) {
    return RunFolder(path(run)).read_config().scene.path;
  }
};

TEST_F(TrainingOfVideo, FindsTheCamerasFirstAndOnce) {
  const Outcome first = train(film("film"), "run");
  ASSERT_EQ(first.code, 0) << first.err;
  EXPECT_NE(first.out.find("16 of 16 placed"), std::string::npos) << first.out;
  EXPECT_EQ(scene_of("run"), path("run") + "/scene");
  EXPECT_TRUE(std::filesystem::exists(path("run/scene/transforms.json")));
  // Cameras that are estimated are refined, and those of test views fitted.
  EXPECT_NE(first.out.find("before cameras were fitted"), std::string::npos) << first.out;

  for (const char* again : {"--overwrite", "--resume"}) {
    const Outcome next = train(path("film"), "run", {again});
    ASSERT_EQ(next.code, 0) << next.err;
    EXPECT_EQ(next.out.find("placed"), std::string::npos) << next.out;
    EXPECT_EQ(scene_of("run"), path("run") + "/scene");
  }
  const Outcome held = train(path("film"), "run", {"--overwrite", "--set", "scene.val_every=8"});
  EXPECT_EQ(held.code, 0) << held.err;
  EXPECT_EQ(scene_of("run"), path("run") + "/scene");
  const Outcome part = train(path("film"), "run", {"--overwrite", "--set", "scene.max_steps=14"});
  ASSERT_EQ(part.code, 0) << part.err;
  EXPECT_NE(part.out.find("14 of 14 placed"), std::string::npos) << part.out;
  EXPECT_EQ(gflow({"eval", path("run"), "--quiet"}).code, 0);
}

TEST_F(TrainingOfVideo, TakesACameraForStaticIfItStandsStillOrIsSaidTo) {
  for (int k = 0; k < 6; ++k)
    write_png(folder().file(fmt::format("still/{}.png", k)), seen_from(3));
  const Outcome still = train(path("still"), "still_run");
  ASSERT_EQ(still.code, 0) << still.err;
  const Outcome said = train(film("film", 6), "said_run", {"--still"});
  ASSERT_EQ(said.code, 0) << said.err;
  EXPECT_EQ(said.err.find("seems to move"), std::string::npos) << said.err;
  for (const char* run : {"still_run", "said_run"})
    EXPECT_FALSE(std::filesystem::exists(path(run) + "/scene")) << run;
}

// A camera that turns on the spot sees no depth.
TEST_F(TrainingOfVideo, SaysWhyCamerasWereNotFoundAndLeavesNothing) {
  for (int k = 0; k < 8; ++k) {
    Eigen::Isometry3d pose = pose_on_arc(3, kFilmed);
    pose = Eigen::AngleAxisd(0.03 * k, Eigen::Vector3d::UnitY()) * pose;
    write_png(folder().file(fmt::format("turn/{}.png", k)),
              image_of_room(pose, kFilmFocal, kFilmWidth, kFilmHeight));
  }
  const Outcome result = train(path("turn"), "run");
  EXPECT_EQ(result.code, 1);
  EXPECT_NE(result.err.find("--still"), std::string::npos) << result.err;
  EXPECT_FALSE(std::filesystem::exists(path("run")));
}

TEST_F(TrainingOfVideo, UsesTheMethodThatIsGiven) {
  for (int k = 0; k < 6; ++k)
    write_png(folder().file(fmt::format("still/{}.png", k)), seen_from(3));
  const Outcome still = train(path("still"), "run", {"--method", "tracks"});
  EXPECT_EQ(still.code, 1);
  EXPECT_NE(still.err.find("the camera does not move"), std::string::npos) << still.err;
  const Outcome colmap =
      gflow({"train", path("still"), "-o", path("run"), "--method", "colmap"}, "PATH=/nowhere");
  EXPECT_EQ(colmap.code, 1);
  EXPECT_NE(colmap.err.find("colmap is not on PATH"), std::string::npos) << colmap.err;
  EXPECT_FALSE(std::filesystem::exists(path("run")));
}

TEST_F(TrainingOfVideo, RefusesAMethodWhereNoCamerasAreFound) {
  const std::string film_folder = film("film", 4);
  folder().write("scene/transforms.json", "{}");
  expect_refused({"train", path("scene"), "-o", path("run"), "--method", "colmap"},
                 {"--method colmap", path("scene"), "has its own cameras (nerfstudio)"});
  expect_refused({"train", film_folder, "-o", path("run"), "--method", "tracks", "--still"},
                 {"--method tracks", "stands still (--still)"});
  EXPECT_FALSE(std::filesystem::exists(path("run")));
}

TEST_F(TrainingOfVideo, ReplacesWhatAStoppedSearchHasLeft) {
  folder().write("run/scene/tracks.npz", "of another version");
  const Outcome result = train(film("film"), "run");
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_FALSE(std::filesystem::exists(path("run/scene/tracks.npz")));
}

// A few frames of something and many of noise: no scene, rather than one of nothing.
TEST_F(CamerasCommand, HardlyAnyFramesThatBelongTogetherAreNoScene) {
  const std::string film = path("noise");
  for (int k = 0; k < 70; ++k) {
    Image image = seen_from(std::min(k, 5));
    if (k > 5)
      for (size_t i = 0; i < image.pixels.size(); ++i)
        image.pixels[i] = uint8_t(255 * random_uniform(7u, uint(k), uint(i)));
    write_png(folder().file(fmt::format("noise/{:02}.png", k)), image);
  }
  const Outcome result = gflow({"cameras", film, "-o", path("scene")});
  EXPECT_EQ(result.code, 1);
  EXPECT_NE(result.err.find("of 70 frames could be placed"), std::string::npos) << result.err;
  EXPECT_FALSE(fs::exists(path("scene")));
}

TEST_F(CamerasCommand, SmallImagesAreNamedAsTheCause) {
  const Outcome result = gflow({"cameras", film("film"), "-o", path("scene"), "-r", "8"});
  EXPECT_EQ(result.code, 1);
  EXPECT_NE(result.err.find("reduced by -r 8"), std::string::npos) << result.err;
}

TEST_F(CamerasCommand, TwoFramesAreTooFew) {
  const Outcome result = gflow({"cameras", film("film", 2), "-o", path("scene"), "--quiet"});
  EXPECT_EQ(result.code, 1);
  EXPECT_NE(result.err.find("has 2 frames, at least 3"), std::string::npos) << result.err;
  EXPECT_NE(result.err.find("film"), std::string::npos) << result.err;
}

TEST_F(CamerasCommand, SaysThatAFolderHasNoImages) {
  std::filesystem::create_directories(path("empty"));
  const Outcome result = gflow({"cameras", path("empty"), "-o", path("scene"), "--quiet"});
  EXPECT_EQ(result.code, 1);
  EXPECT_EQ(result.err, fmt::format("gflow: finding the cameras of {}: the folder has no numbered "
                                    "images; give a video, or a folder of images such as "
                                    "0001.png, 0002.png, 0003.png\n",
                                    path("empty")));
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
