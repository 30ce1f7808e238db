// SPDX-License-Identifier: Apache-2.0
// `gflow render` as a user runs it.

#include "tests/support/command_scene.hpp"

namespace gflow {
namespace {

class RenderCommand : public CommandTest {};

TEST_F(RenderCommand, RenderDoesNotMixItsFilesWithThoseOfARun) {
  expect_refused({"render", run(), "-o", run()}, {"it belongs to a run", run() + "/images"});
  expect_refused({"render", run(), "-o", run() + "/"}, {"it belongs to a run"});
  const auto before = fs::last_write_time(scene().path());
  expect_refused({"render", run(), "-o", scene().path()}, {"it contains a scene (n3v)"});
  EXPECT_EQ(fs::last_write_time(scene().path()), before);  // nothing new is written there
  expect_refused({"render", run(), "-o", run() + "/flow/new"}, {"it belongs to a run"});
  expect_refused({"render", model(), "-o", run() + "/point_cloud/../test"},
                 {"it belongs to a run"});
  EXPECT_FALSE(fs::exists(run() + "/rgb"));
  const Outcome outcome = gflow({"render", run(), "-o", run() + "/images", "--quiet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  fs::remove_all(run() + "/images");
}

TEST_F(RenderCommand, RenderLeavesAFolderOfOthersAlone) {
  const TemporaryFolder folder, begun;
  const std::string video = folder.write("cam00.mp4", "a film of my own");
  const std::vector<std::string> render{"render", run(), "-o", folder.path(), "--quiet"};
  expect_refused(render, {folder.path(), "not empty", "new folder"});
  EXPECT_EQ(contents(video), "a film of my own");
  EXPECT_EQ(folder.count(), 1u);
  fs::create_directory(folder.path() + "/rgb");  // may contain images as well
  expect_refused(render, {"not empty"});
  const TemporaryFolder data;  // such as a scanner's
  for (const char* kind : {"/rgb", "/alpha", "/depth"}) fs::create_directory(data.path() + kind);
  for (const char* name : {"rgb/cam00_0000.png", "rgb/cam00_0001.png", "depth/cam00_0000.png"})
    data.write(name, "mine");
  expect_refused({"render", run(), "-o", data.path()}, {data.path(), "not empty"});
  EXPECT_EQ(contents(data.file("rgb/cam00_0000.png")), "mine");
  for (const char* kind : {"rgb", "alpha"}) fs::create_directory(begun.path() + "/" + kind);
  for (const char* more : {"stopped while it began", "with notes beside it"}) {
    EXPECT_EQ(gflow({"render", run(), "-o", begun.path(), "--quiet"}).code, 0) << more;
    begun.write("notes.txt", "seen");
  }
}

TEST_F(RenderCommand, RenderDividesTheSize) {
  const TemporaryFolder of_run, of_file;
  EXPECT_EQ(gflow({"render", run(), "-o", of_run.path(), "-r", "2", "--quiet"}).code, 0);
  EXPECT_EQ(read_image(of_run.path() + "/rgb/cam00_0000.png").width, 24);
  const TemporaryFolder folder;
  fs::copy_file(model(), folder.file("bare.ply"));
  EXPECT_EQ(gflow({"render", folder.file("bare.ply"), "--scene", scene().path(), "-o",
                   of_file.path(), "-r", "4", "--quiet"})
                .code,
            0);
  EXPECT_EQ(read_image(of_file.path() + "/rgb/cam00_0000.png").height, 10);
}

TEST_F(RenderCommand, RenderWritesTheImagesOfTheTestViews) {
  const TemporaryFolder out;
  const Outcome outcome = gflow({"render", run(), "-o", out.path(), "--quiet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  for (const char* name :
       {"rgb/cam00_0004.png", "alpha/cam00_0000.png", "depth/cam00_0000.png",
        "depth/cam00_0000.json", "depth/cam00_0000.npy", "flow/cam00_0000.flo",
        "flow/cam00_0000.png", "compare/cam00_0000.png", "cam00.mp4", "compare_cam00.mp4"})
    EXPECT_TRUE(fs::exists(out.path() + "/" + name)) << name;
  EXPECT_NE(outcome.out.find(out.path() + "/cam00.mp4"), std::string::npos) << outcome.out;
}

TEST_F(RenderCommand, RenderDrawsACameraAtTheTimesAskedFor) {
  const TemporaryFolder out;
  const std::vector<std::string> render{"render", model(),   "-o",    out.path(),     "--camera",
                                        "cam02",  "--times", "0:1:3", "--no-compare", "--quiet"};
  for (int once : {1, 2}) {  // the second time it overwrites its own files
    const Outcome outcome = gflow(render);
    EXPECT_EQ(outcome.code, 0) << once << outcome.err;
  }
  EXPECT_TRUE(fs::exists(out.path() + "/rgb/cam02_0002.png"));
  EXPECT_FALSE(fs::exists(out.path() + "/rgb/cam02_0003.png"));
  EXPECT_FALSE(fs::exists(out.path() + "/compare"));
}

TEST_F(RenderCommand, RenderSwaysAroundOneCamera) {
  const TemporaryFolder out;
  const Outcome outcome = gflow({"render", run(), "-o", out.path(), "--camera", "cam02", "--times",
                                 "0:1:3", "--sway", "8", "--quiet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(fs::exists(out.path() + "/rgb/sway_0002.png"));
  EXPECT_TRUE(fs::exists(out.path() + "/sway.mp4"));
  EXPECT_FALSE(fs::exists(out.path() + "/compare"));
}

TEST_F(RenderCommand, RenderOfABarePlyGoesAroundIt) {
  const TemporaryFolder folder, out;
  fs::copy_file(model(), folder.file("bare.ply"));
  const Outcome outcome =
      gflow({"render", folder.file("bare.ply"), "-o", out.path(), "--times", "0:1:2", "--quiet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(fs::exists(out.path() + "/rgb/orbit_0001.png"));
  EXPECT_TRUE(fs::exists(out.path() + "/orbit.mp4"));
}

TEST_F(RenderCommand, RenderUsesCamerasBesideAPlyOfNoScene) {
  const TemporaryFolder folder, out;
  fs::copy_file(model(), folder.file("bare.ply"));
  fs::copy_file(run() + "/cameras.json", folder.file("cameras.json"));
  const Outcome outcome =
      gflow({"render", folder.file("bare.ply"), "-o", out.path(), "--times", "0.5", "--quiet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  for (const char* name : {"rgb/cam00.png", "rgb/cam03.png", "cameras.mp4"})
    EXPECT_TRUE(fs::exists(out.path() + "/" + name)) << name;
}

TEST_F(RenderCommand, RenderSaysWhatIsMissing) {
  const TemporaryFolder folder;
  fs::copy_file(model(), folder.file("bare.ply"));
  const std::string out = folder.path() + "/out", bare = folder.file("bare.ply");
  expect_refused({"render", folder.path() + "/none", "-o", out},
                 {"cannot read ", "/none: there is no such run folder or splat file"});
  expect_refused({"render", folder.path(), "-o", out}, {"config.toml"});
  expect_refused({"render", bare, "-o", out, "--split", "test"}, {"--scene"});
  expect_refused({"render", bare, "-o", out, "--camera", "cam00"}, {"cam00", "cameras.json"});
  expect_refused({"render", run(), "-o", out, "--camera", "cam9"}, {"cam9", "cam00, cam01"});
  expect_refused({"render", run(), "-o", out, "--split", "val"}, {"no val views"});
  expect_refused({"render", run(), "-o", out, "--times", "2"}, {"--times 2", "0:1:40"});
  EXPECT_FALSE(fs::exists(out));
}

// Frames of videos would be unpacked there.
TEST_F(RenderCommand, NoTemporaryFolderIsToldWithTheVariable) {
  const TemporaryFolder folder;
  fs::copy_file(model(), folder.file("bare.ply"));
  expect_refused({"render", folder.file("bare.ply"), "--scene", GFLOW_SOURCE_DIR "/apps/demo/scene",
                  "-o", folder.path() + "/out"},
                 {"cannot create a temporary folder in " + folder.path() + "/none (from TMPDIR)",
                  "set TMPDIR"},
                 "export TMPDIR=" + folder.path() + "/none");
  EXPECT_FALSE(fs::exists(folder.path() + "/out"));
}

TEST_F(RenderCommand, ASingleTimeHasFlowWhereTheSceneHasANextStep) {
  const TemporaryFolder out;
  const auto render = [&](const std::string& model, const std::string& time) {
    const Outcome outcome =
        gflow({"render", model, "-o", out.path(), "--camera", "cam02", "--times", time, "--quiet"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_NE(outcome.out.find("video     none"), std::string::npos) << outcome.out;
    return outcome.out;
  };
  EXPECT_NE(render(run(), "0.5").find("flow      1 views"), std::string::npos);
  EXPECT_TRUE(fs::exists(out.path() + "/flow/cam02.flo"));
  EXPECT_NE(render(run(), "1").find("flow      none"), std::string::npos);
  const TemporaryFolder folder;
  fs::copy_file(model(), folder.file("bare.ply"));
  fs::copy_file(run() + "/cameras.json", folder.file("cameras.json"));
  EXPECT_NE(render(folder.file("bare.ply"), "0.5").find("flow      none"), std::string::npos);
}

}  // namespace
}  // namespace gflow
