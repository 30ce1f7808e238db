// SPDX-License-Identifier: Apache-2.0
// The gflow program as a user runs it: what it writes, what it says, how it exits.
#include "train/command.hpp"

#include <nlohmann/json.hpp>

#include "optim/data/movie.hpp"
#include "optim/io/npz.hpp"
#include "train/small_scene.hpp"

namespace gflow {
namespace {

// A scene and, where asked for, a run of three steps on it.
class CommandTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    Queue queue = test_queue();
    scene_ = new SmallScene(queue);
    folder_ = new TemporaryFolder;
    trained_ = gflow({"train", scene_->path(), "-o", run(), "--iterations", "3", "--quiet"});
  }
  static void TearDownTestSuite() {
    delete scene_;
    delete folder_;
  }
  static std::string run() { return folder_->path() + "/run"; }
  static std::string model() { return run() + "/point_cloud/iteration_3/point_cloud.ply"; }
  static const SmallScene& scene() { return *scene_; }
  static const Outcome& trained() { return trained_; }

 private:
  static SmallScene* scene_;
  static TemporaryFolder* folder_;
  static Outcome trained_;
};
SmallScene* CommandTest::scene_ = nullptr;
TemporaryFolder* CommandTest::folder_ = nullptr;
Outcome CommandTest::trained_;

TEST_F(CommandTest, TrainWritesTheRunAndNamesIt) {
  EXPECT_EQ(trained().code, 0) << trained().err;
  EXPECT_EQ(trained().err, "");  // --quiet
  for (const std::string& path : {model(), run() + "/results.json", run() + "/per_view.json"}) {
    EXPECT_TRUE(fs::exists(path)) << path;
    EXPECT_NE(trained().out.find(path), std::string::npos) << path;
  }
  for (const char* name :
       {"config.toml", "cameras.json", "metrics.jsonl", "metrics.csv", "compare.png", "input.ply"})
    EXPECT_TRUE(fs::exists(run() + "/" + name)) << name;
  const auto results = nlohmann::json::parse(contents(run() + "/results.json"));
  EXPECT_EQ(results["iterations"], 3);
  EXPECT_EQ(results["test"]["views"], 5);
}

TEST_F(CommandTest, TrainTakesAVideoFileAndADivisor) {
  const TemporaryFolder folder;
  const std::string video = folder.file("video.mp4"), run = folder.file("run");
  write_movie(
      video, 3,
      [](size_t k) {
        Image image{64, 48, 3, std::vector<uint8_t>(64 * 48 * 3, 200)};
        for (size_t i = 0; i < 3000; ++i) image.pixels[1000 + 300 * k + i] = 50;
        return image;
      },
      10);
  const Outcome outcome =
      gflow({"train", video, "-o", run, "-r", "2", "--iterations", "2", "--quiet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const Image frame = read_image(run + "/frames/input/00002.png");
  EXPECT_EQ(frame.width, 32);
  const auto results = nlohmann::json::parse(contents(run + "/results.json"));
  EXPECT_EQ(results["resolution"], 2);
  EXPECT_EQ(results["test"]["views"], 3);
  EXPECT_EQ(gflow({"render", run, "-o", folder.file("pictures"), "--quiet"}).code, 0);
  EXPECT_TRUE(fs::exists(folder.path() + "/pictures/compare"));
  expect_refused({"train", video, "-o", run, "-r", "3"}, {"scene.resolution", "3", "1, 2, 4, 8"});
  expect_refused({"train", folder.file("none.mp4"), "-o", run}, {"none.mp4", "no such"});
}

TEST_F(CommandTest, TrainSaysWhatItFound) {
  const TemporaryFolder folder;
  const Outcome outcome = gflow({"train", scene().path(), "-o", folder.file("run"), "--iterations",
                                 "1", "--set", "flow.source=files"});
  EXPECT_NE(outcome.err.find("scene: n3v, 4 cameras, 5 time steps; pictures: 15 for training, 5 "
                             "for the test, 0 for validation, 48x40\n"),
            std::string::npos)
      << outcome.err;
  EXPECT_NE(outcome.err.find("first Gaussians: 94 at points of the scene, and "), std::string::npos)
      << outcome.err;
  EXPECT_EQ(outcome.err.find("test views:"), std::string::npos) << outcome.err;
  EXPECT_EQ(nlohmann::json::parse(contents(folder.file("run/results.json")))["test"]["trained_on"],
            false);
  const Outcome still =
      gflow({"train", scene().path(), "-o", folder.file("still"), "--iterations", "1", "--set",
             "flow.source=files", "--set", "init.dynamic=0", "--init", "random"});
  EXPECT_NE(still.err.find(" at random places\n"), std::string::npos) << still.err;
}

// The same pictures, numbered: one camera, and no others to test with.
TEST_F(CommandTest, TestViewsThatWereTrainedOnAreMarked) {
  const TemporaryFolder folder;
  fs::copy(scene().path() + "/cam01/images", folder.path() + "/pictures");
  const std::string run = folder.file("run");
  const Outcome outcome = gflow({"train", folder.path() + "/pictures", "-o", run, "--iterations",
                                 "1", "--set", "init.count=500"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("consistent4d, 1 camera, 5 time"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("test views: there are none but the training views"),
            std::string::npos)
      << outcome.err;
  EXPECT_NE(outcome.out.find("5 views, all of which were trained on"), std::string::npos)
      << outcome.out;
  const auto results = nlohmann::json::parse(contents(run + "/results.json"));
  EXPECT_EQ(results["test"]["trained_on"], true);
}

TEST_F(CommandTest, SettingsWithoutEffectAreNamed) {
  const TemporaryFolder folder;
  const std::string cameras = run() + "/cameras.json", out = folder.path() + "/run";
  expect_refused({"train", scene().path(), "-o", out, "--cameras", cameras},
                 {"--cameras", "cameras of its own (n3v)", "numbered pictures"});
  EXPECT_FALSE(fs::exists(out));
  const Outcome outcome =
      gflow({"train", scene().path(), "-o", out, "--iterations", "1", "--quiet", "--set",
             "scene.cameras=" + cameras, "--set", "motion.model=hexplane", "--set",
             "motion.rest=0.1", "--set", "density.enabled=false", "--set", "flow.source=files"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  for (const char* setting : {"scene.cameras = ", "motion.rest = 0.1", "density.enabled = false"})
    EXPECT_NE(outcome.err.find(std::string("gflow: warning: ") + setting), std::string::npos)
        << setting << " in " << outcome.err;
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 3) << outcome.err;
}

TEST_F(CommandTest, EvalOfAnEarlierIterationLeavesTheResultsOfTheLatest) {
  const TemporaryFolder folder;
  const std::string run = folder.file("run");
  ASSERT_EQ(gflow({"train", scene().path(), "-o", run, "--iterations", "3", "--save-every", "2",
                   "--quiet", "--set", "flow.source=files"})
                .code,
            0);
  const auto all = [&] {
    std::map<std::string, std::string> files;
    for (const char* name : {"results.json", "per_view.json", "compare.png", "test/cam00_0000.png"})
      files[name] = contents(run + "/" + name);
    return files;
  };
  const auto before = all();
  const Outcome early = gflow({"eval", run, "--iteration", "2", "--quiet"});
  EXPECT_EQ(early.code, 0) << early.err;
  EXPECT_TRUE(all() == before);
  const std::string results = run + "/results_iteration_2.json";
  EXPECT_NE(early.out.find(results), std::string::npos) << early.out;
  EXPECT_EQ(nlohmann::json::parse(contents(results))["iterations"], 2);
  EXPECT_TRUE(fs::exists(run + "/per_view_iteration_2.json"));
  EXPECT_EQ(gflow({"eval", run, "--iteration", "2", "--split", "train", "--quiet"}).code, 0);
  EXPECT_TRUE(fs::exists(run + "/results_train_iteration_2.json"));
  fs::remove(run + "/results.json");
  EXPECT_EQ(gflow({"eval", run, "--iteration", "3", "--quiet"}).code, 0);  // the latest
  EXPECT_EQ(contents(run + "/results.json"), before.at("results.json"));
}

TEST_F(CommandTest, RenderDoesNotMixItsFilesWithThoseOfARun) {
  expect_refused({"render", run(), "-o", run()}, {"files of a run", run() + "/pictures"});
  expect_refused({"render", run(), "-o", run() + "/"}, {"files of a run"});
  expect_refused({"render", run(), "-o", run() + "/flow/new"}, {"files of a run"});
  expect_refused({"render", model(), "-o", run() + "/point_cloud/../test"}, {"files of a run"});
  EXPECT_FALSE(fs::exists(run() + "/rgb"));
  const Outcome outcome = gflow({"render", run(), "-o", run() + "/pictures", "--quiet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  fs::remove_all(run() + "/pictures");
}

TEST_F(CommandTest, RenderDividesTheSize) {
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

TEST_F(CommandTest, EvalFindsWhatTrainFound) {
  const auto before = nlohmann::json::parse(contents(run() + "/results.json"));
  fs::remove(run() + "/results.json");
  const Outcome outcome = gflow({"eval", run(), "--quiet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("PSNR"), std::string::npos);
  const auto after = nlohmann::json::parse(contents(run() + "/results.json"));
  EXPECT_EQ(after, before);
}

TEST_F(CommandTest, RenderWritesThePicturesOfTheTestViews) {
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

TEST_F(CommandTest, RenderDrawsACameraAtTheTimesAskedFor) {
  const TemporaryFolder out;
  const Outcome outcome = gflow({"render", model(), "-o", out.path(), "--camera", "cam02",
                                 "--times", "0:1:3", "--no-compare", "--quiet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(fs::exists(out.path() + "/rgb/cam02_0002.png"));
  EXPECT_FALSE(fs::exists(out.path() + "/rgb/cam02_0003.png"));
  EXPECT_FALSE(fs::exists(out.path() + "/compare"));
}

TEST_F(CommandTest, RenderOfABarePlyGoesAroundIt) {
  const TemporaryFolder folder, out;
  fs::copy_file(model(), folder.file("bare.ply"));
  const Outcome outcome =
      gflow({"render", folder.file("bare.ply"), "-o", out.path(), "--times", "0:1:2", "--quiet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(fs::exists(out.path() + "/rgb/orbit_0001.png"));
  EXPECT_TRUE(fs::exists(out.path() + "/orbit.mp4"));
}

TEST_F(CommandTest, RenderUsesCamerasBesideAPlyOfNoScene) {
  const TemporaryFolder folder, out;
  fs::copy_file(model(), folder.file("bare.ply"));
  fs::copy_file(run() + "/cameras.json", folder.file("cameras.json"));
  const Outcome outcome =
      gflow({"render", folder.file("bare.ply"), "-o", out.path(), "--times", "0.5", "--quiet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  for (const char* name : {"rgb/cam00.png", "rgb/cam03.png", "cameras.mp4"})
    EXPECT_TRUE(fs::exists(out.path() + "/" + name)) << name;
}

TEST_F(CommandTest, RenderSaysWhatIsMissing) {
  const TemporaryFolder folder;
  fs::copy_file(model(), folder.file("bare.ply"));
  const std::string out = folder.path() + "/out", bare = folder.file("bare.ply");
  expect_refused({"render", folder.path() + "/none", "-o", out}, {"/none"});
  expect_refused({"render", folder.path(), "-o", out}, {"config.toml"});
  expect_refused({"render", bare, "-o", out, "--split", "test"}, {"--scene"});
  expect_refused({"render", bare, "-o", out, "--camera", "cam00"}, {"cam00", "cameras.json"});
  expect_refused({"render", run(), "-o", out, "--camera", "cam9"}, {"cam9", "cam00, cam01"});
  expect_refused({"render", run(), "-o", out, "--split", "val"}, {"no val views"});
  expect_refused({"render", run(), "-o", out, "--times", "2"}, {"--times 2", "0:1:40"});
  EXPECT_FALSE(fs::exists(out));
}

// Keys as in the oracle's scenes; two Gaussians before a camera at the origin.
Array floats(std::vector<size_t> shape, std::vector<float> values) {
  return {std::move(shape), std::move(values)};
}
Arrays small_npz() {
  return {{"means", floats({2, 3}, {0, 0, 2, 0.2f, 0, 3})},
          {"quats", floats({2, 4}, {1, 0, 0, 0, 1, 0, 0, 0})},
          {"scales", floats({2, 3}, std::vector<float>(6, 0.1f))},
          {"opacities", floats({2}, {0.5f, 0.5f})},
          {"colors", floats({2, 3}, {1, 0, 0, 0, 1, 0})},
          {"viewmat", floats({4, 4}, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1})},
          {"K", floats({3, 3}, {16, 0, 8, 0, 16, 6, 0, 0, 1})},
          {"size", Array{{2}, std::vector<int32_t>{16, 12}}}};
}

TEST_F(CommandTest, ExportWritesOneTimeThatInfoAndImportAndTrainRead) {
  const TemporaryFolder folder;
  const std::string ply = folder.file("now.ply"), splat = folder.file("now.splat");
  EXPECT_EQ(gflow({"export", run(), "-o", ply, "--times", "0.25"}).err, "");
  EXPECT_EQ(gflow({"export", model(), "-o", splat, "--format", "splat", "--times", "0.25"}).err,
            "");
  const auto moving = nlohmann::json::parse(gflow({"info", run(), "--json"}).out);
  EXPECT_EQ(moving["motion"], "spacetime");
  EXPECT_EQ(moving["iterations"], 3);
  const auto still = nlohmann::json::parse(gflow({"info", ply, "--json"}).out);
  EXPECT_EQ(still["motion"], "none");
  EXPECT_EQ(still["format"], "ply");
  EXPECT_GT(still["gaussians"], 0);
  EXPECT_EQ(gflow({"import", splat, "-o", folder.file("back.ply")}).err, "");
  const auto back = nlohmann::json::parse(gflow({"info", folder.file("back.ply"), "--json"}).out);
  EXPECT_EQ(back["gaussians"], still["gaussians"]);
  const Outcome again = gflow({"train", scene().path(), "-o", folder.file("run"), "--iterations",
                               "1", "--init", splat, "--set", "init.dynamic=0", "--quiet"});
  EXPECT_EQ(again.code, 0) << again.err;
  const auto first =
      nlohmann::json::parse(gflow({"info", folder.file("run/input.ply"), "--json"}).out);
  EXPECT_EQ(first["gaussians"], still["gaussians"]);
}

TEST_F(CommandTest, ExportTakesTheFormatFromTheEnding) {
  const TemporaryFolder folder;
  const auto exported = [&](const std::string& name) {
    const std::string path = folder.path() + "/" + name;
    const Outcome outcome = gflow({"export", run(), "-o", path, "--quiet"});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return contents(path).substr(0, 4);
  };
  EXPECT_EQ(exported("a.ply"), "ply\n");
  EXPECT_EQ(exported("b.PLY"), "ply\n");
  EXPECT_EQ(exported("a.splatv").substr(0, 2), "Kg");
  exported("a.splat");
  exported("a.4dgs");
  const auto kind = [&](const std::string& name) {
    return nlohmann::json::parse(gflow({"info", folder.file(name), "--json"}).out)["format"];
  };
  EXPECT_EQ(kind("a.splat"), "splat");
  EXPECT_EQ(kind("a.4dgs"), "4dgs");
  const auto refused = [&](const std::string& name, const std::vector<std::string>& more,
                           std::initializer_list<std::string> parts) {
    std::vector<std::string> arguments{"export", run(), "-o", folder.path() + "/" + name};
    arguments.insert(arguments.end(), more.begin(), more.end());
    expect_refused(arguments, parts);
    EXPECT_FALSE(fs::exists(folder.path() + "/" + name)) << name;
  };
  refused("x.spz", {}, {"x.spz", "no .spz files", ".splatv"});
  refused("x.foo", {"--format", "ply"}, {"x.foo", "no .foo files"});
  refused("x", {}, {"nothing says in which format", "--format"});
  refused("x.splat", {"--format", "ply"}, {"ending says splat", "--format says ply"});
  refused("x.ply", {"--format", "ply-sequence"}, {"ending says ply", "ply-sequence"});
}

TEST_F(CommandTest, ExportWritesASequenceOfTheStepsOfTheScene) {
  const TemporaryFolder folder;
  EXPECT_EQ(
      gflow({"export", run(), "--format", "ply-sequence", "-o", folder.file("a"), "--quiet"}).code,
      0);
  for (const char* name : {"a/frame_0001.ply", "a/frame_0005.ply"})
    EXPECT_TRUE(fs::exists(folder.file(name))) << name;
  EXPECT_EQ(folder.count(), 5u);
  expect_refused({"export", run(), "--format", "ply-sequence", "-o", folder.file("a")},
                 {"not an empty folder"});
  EXPECT_EQ(gflow({"export", run(), "--format", "splatv", "-o", folder.file("a.splatv")}).code, 0);
  EXPECT_EQ(contents(folder.file("a.splatv")).substr(0, 2), "Kg");
}

TEST_F(CommandTest, ExportTakesAllTimesOfTheSceneAsRenderDoes) {
  const TemporaryFolder folder;
  const auto exported = [&](const std::string& name, const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"export", run(), "-o", folder.path() + "/" + name,
                                       "--quiet"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return gflow(arguments);
  };
  for (const std::string format : {"ply-sequence", "4dgs", "splatv"})
    EXPECT_EQ(exported(format, {"--format", format, "--times", "all"}).code, 0) << format;
  EXPECT_EQ(folder.count(), 5u + 2);
  expect_refused({"export", run(), "-o", folder.path() + "/a.ply", "--times", "all"},
                 {"one time", "every step", "ply-sequence"});
  expect_refused(
      {"export", model(), "-o", folder.path() + "/a", "--format", "ply-sequence", "--times", "all"},
      {"--steps or --times"});
}

TEST_F(CommandTest, AnIterationIsChosenOfARunOnly) {
  expect_refused({"info", model(), "--iteration", "3"}, {"--iteration 3", "run folder"});
  expect_refused({"info", scene().path(), "--iteration", "3"}, {"--iteration 3", "run folder"});
  expect_refused({"render", model(), "-o", "/nowhere/out", "--iteration", "3"}, {"--iteration 3"});
  expect_refused({"eval", run(), "--iteration", "4"}, {"iteration 4", "there are 3"});
  expect_refused({"eval", run(), "--iteration", "x"}, {"--iteration", "'x'"});
}

TEST_F(CommandTest, ADamagedVideoIsOneSentenceOfOursAlone) {
  const TemporaryFolder folder;
  const std::string whole = contents(GFLOW_SOURCE_DIR "/apps/demo/scene/cam01.mp4");
  const std::string cut = folder.write("cut.mp4", whole.substr(0, whole.size() / 2));
  const std::string out = folder.path() + "/run";
  expect_refused({"train", cut, "-o", out}, {"cut.mp4"});
  // Who wants to know more is told.
  const Outcome told = gflow({"train", cut, "-o", out}, "export OPENCV_FFMPEG_LOGLEVEL=24");
  EXPECT_NE((told.out + told.err).find("moov"), std::string::npos) << told.err;
}

TEST_F(CommandTest, AMovingFileGoesOutAndItsMomentsComeIn) {
  const TemporaryFolder folder;
  const std::string moving = folder.file("a.4dgs"), now = folder.file("now.ply");
  const Outcome written =
      gflow({"export", run(), "--format", "4dgs", "-o", moving, "--fps", "10", "--quiet"});
  EXPECT_EQ(written.code, 0);
  EXPECT_NE(written.out.find("0.5 s"), std::string::npos) << written.out;  // 5 steps
  const auto info = nlohmann::json::parse(gflow({"info", moving, "--json"}).out);
  EXPECT_EQ(info["format"], "4dgs");
  EXPECT_EQ(info["seconds"], 0.5);
  EXPECT_GT(info["gaussians"], 0);
  EXPECT_EQ(gflow({"import", moving, "-o", now, "--time", "0.2"}).code, 0);
  EXPECT_EQ(nlohmann::json::parse(gflow({"info", now, "--json"}).out)["motion"], "none");
  expect_refused({"import", moving, "-o", now, "--time", "0.5"}, {"--time 0.5", "0.5 s"});
  expect_refused({"import", now, "-o", folder.file("b.ply"), "--time", "0"}, {"--time", "is ply"});
  expect_refused({"render", moving, "-o", folder.file("r")}, {"a.4dgs", "gflow import"});
  expect_refused({"export", run(), "--format", "4dgs", "-o", moving, "--times", "0,1"},
                 {"all times", "--steps"});
  expect_refused({"export", model(), "--format", "4dgs", "-o", moving}, {"--steps says it"});
}

TEST_F(CommandTest, FilesInAndOutSayWhatIsWrong) {
  const TemporaryFolder folder;
  const std::string out = folder.file("out.ply");
  expect_refused({"export", run(), "-o", out, "--times", "0,1"}, {"--format ply", "one time"});
  expect_refused({"export", run(), "-o", out, "--steps", "3"}, {"--steps", "ply-sequence"});
  expect_refused({"export", run(), "-o", folder.path() + "/a.splatv", "--times", "0"},
                 {"all times"});
  expect_refused({"export", model(), "-o", folder.path() + "/a", "--format", "ply-sequence"},
                 {"--steps or --times"});
  expect_refused({"export", folder.file("none.ply"), "-o", out}, {"none.ply", "missing"});
  expect_refused({"import", model(), "-o", out}, {"moving model", "gflow export"});
  expect_refused({"import", folder.write("a.splat", "what?"), "-o", out}, {"a.splat", "32 bytes"});
  expect_refused({"info", folder.write("b.xyz", "what?")}, {"b.xyz", ".spz"});
  expect_refused({"train", scene().path(), "-o", folder.file("run"), "--init", model()},
                 {"moves", "gflow export"});
  EXPECT_FALSE(fs::exists(out));
}

TEST_F(CommandTest, InfoTellsWhatAnySceneIs) {
  const auto info = nlohmann::json::parse(gflow({"info", scene().path(), "--json"}).out);
  EXPECT_EQ(info["layout"], "n3v");
  EXPECT_EQ(info["steps"], 5);
  EXPECT_NE(gflow({"info", scene().path()}).out.find("n3v"), std::string::npos);
}

TEST_F(CommandTest, SplatDrawsAnArchive) {
  const TemporaryFolder folder;
  Arrays input = small_npz();
  input["v_rgb"] = Array{{12, 16, 3}, std::vector<float>(12 * 16 * 3, 1.f)};
  write_npz(folder.file("in.npz"), input);
  const Outcome outcome = gflow({"splat", folder.file("in.npz"), "-o", folder.file("out.npz")});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  const Arrays output = read_npz(folder.file("out.npz"));
  EXPECT_EQ(output.at("rgb").shape, (std::vector<size_t>{12, 16, 3}));
  EXPECT_EQ(output.at("alpha").shape, (std::vector<size_t>{12, 16}));
  EXPECT_EQ(output.at("g_rgb_means").shape, (std::vector<size_t>{2, 3}));
}

TEST_F(CommandTest, SplatRefusesArchivesThatAreBroken) {
  const TemporaryFolder folder;
  const std::string out = folder.path() + "/out.npz";
  expect_refused({"splat", folder.path() + "/none.npz", "-o", out}, {"none.npz"});
  folder.write("text.npz", "this is no archive");
  expect_refused({"splat", folder.file("text.npz"), "-o", out}, {"text.npz"});
  Arrays input = small_npz();
  input.erase("scales");
  write_npz(folder.file("less.npz"), input);
  expect_refused({"splat", folder.file("less.npz"), "-o", out}, {"less.npz", "scales"});
  input = small_npz();
  input["opacities"] = Array{{3}, std::vector<float>(3, 0.5f)};
  write_npz(folder.file("odd.npz"), input);
  expect_refused({"splat", folder.file("odd.npz"), "-o", out}, {"odd.npz", "opacities"});
  input = small_npz();
  input["viewmat"] = floats({4, 4}, {1, 0, 0, NAN, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1});
  write_npz(folder.file("nan.npz"), input);
  expect_refused({"splat", folder.file("nan.npz"), "-o", out}, {"nan.npz", "viewmat", "finite"});
  input = small_npz();
  input["K"] = floats({3, 3}, {-16, 0, 8, 0, 16, 6, 0, 0, 1});
  write_npz(folder.file("flip.npz"), input);
  expect_refused({"splat", folder.file("flip.npz"), "-o", out}, {"flip.npz", "focal length"});
  input = small_npz();
  input["v_flow"] = Array{{12, 16, 2}, std::vector<float>(12 * 16 * 2, 1.f)};
  write_npz(folder.file("still.npz"), input);
  expect_refused({"splat", folder.file("still.npz"), "-o", out}, {"still.npz", "means_t2"});
  EXPECT_FALSE(fs::exists(out));
}

TEST_F(CommandTest, TrainSaysWhatIsWrongWithTheSceneOrTheSettings) {
  const TemporaryFolder folder;
  const std::string out = folder.path() + "/run";
  expect_refused({"train", folder.path() + "/none", "-o", out}, {"/none", "no such folder"});
  expect_refused({"train", folder.path(), "-o", out}, {"no scene gflow knows"});
  expect_refused({"train", scene().path(), "-o", out, "--set", "flow.wieght=1"},
                 {"flow.wieght", "flow.weight"});
  expect_refused({"train", scene().path(), "-o", out, "--set", "flow.weight=-1"},
                 {"flow.weight", "at least 0"});
  expect_refused({"train", scene().path(), "-o", out, "--config", folder.path() + "/none.toml"},
                 {"none.toml"});
  expect_refused(
      {"train", scene().path(), "-o", out, "--init", "visual_hull"},
      {"--init visual_hull", "no such file", "auto, points, stereo, random, visual-hull, file"});
  expect_refused({"train", scene().path(), "-o", out, "--init", "file"}, {"init.file names none"});
  expect_refused({"train", scene().path(), "-o", out, "--init", "visual-hull"}, {"no alpha"});
  fs::copy(scene().path(), folder.path() + "/tracked", fs::copy_options::recursive);
  folder.write("tracked/tracks3d.npy", "no tracks");  // compared with at the end only
  expect_refused({"train", folder.path() + "/tracked", "-o", out}, {"tracks3d.npy"});
  EXPECT_FALSE(fs::exists(out));
  folder.write("file", "");
  expect_refused({"train", scene().path(), "-o", folder.path() + "/file/run"}, {"file/run"});
}

TEST_F(CommandTest, EvalSaysWhatIsMissing) {
  const TemporaryFolder folder;
  expect_refused({"eval", folder.path()}, {"config.toml"});
  fs::copy_file(run() + "/config.toml", folder.file("config.toml"));
  expect_refused({"eval", folder.path()}, {"no model"});
  expect_refused({"eval", run(), "--split", "final"}, {"final", "test, train or val"});
}

TEST_F(CommandTest, AnUnknownDeviceHasACodeOfItsOwn) {
  const Outcome outcome = gflow({"eval", run(), "--device", "no such device"});
  EXPECT_EQ(outcome.code, 2);
  EXPECT_NE(outcome.err.find("no such device"), std::string::npos) << outcome.err;
}

TEST_F(CommandTest, TheDeviceInTheSettingsIsForTrainingAlone) {
  const TemporaryFolder folder;
  const std::string copy = folder.path() + "/run", wanted = "train.device=no such device";
  EXPECT_EQ(gflow({"train", scene().path(), "-o", copy, "--set", wanted}).code, 2);
  fs::copy(run(), copy, fs::copy_options::recursive);
  TrainConfig config = RunFolder::open(copy).read_config();
  config.train.device = "no such device";
  RunFolder(copy).write_config(config);
  EXPECT_EQ(gflow({"eval", copy, "--quiet"}).code, 0);
}

TEST_F(CommandTest, AWrongCommandLineIsAnsweredWithWhatIsNearest) {
  const std::string out = "/nowhere/out";
  expect_refused({}, {"a command is missing",
                      "train, render, eval, export, info, import, splat, bench or devices"});
  expect_refused({"trian", "scene", "-o", out}, {"`gflow trian`", "nearest is train", "splat"});
  expect_refused({"--quiet", "device"}, {"`gflow device`", "nearest is devices"});
  expect_refused({"--device"}, {"--device", "missing", "gflow --help"});
  expect_refused({"--zzzzzz"}, {"no option --zzzzzz (see"});
  expect_refused({"bench"}, {"a command is missing", "gflow bench raster"});
  expect_refused({"bench", "rastr"}, {"`gflow bench rastr`", "raster"});
  expect_refused({"eval", run(), "--splt=test"}, {"no option --splt,", "--split", "--help"});
  expect_refused({"devices", "--jsn"}, {"--jsn", "nearest is --json"});
  expect_refused({"eval", run(), "more"}, {"`gflow eval`", "'more'"});
  expect_refused({"train", "scene"}, {"--output is required", "gflow train --help"});
  expect_refused({"splat", "a.npz", "-o", out, "--transport", "papr"},
                 {"--transport", "'papr'", "paper, ot, material or translate"});
  expect_refused({"splat", "a.npz", "-o", out, "--stop", "x"}, {"'x'", "include or exclude"});
  expect_refused({"splat", "a.npz", "-o", out, "--lanes", "3"}, {"'3'", "0, 1, 4, 8 or 16"});
  expect_refused({"render", run(), "-o", out, "--up", "w"}, {"'w'", "-y or -z"});
  expect_refused({"render", run(), "-o", out, "--fps", "nan"}, {"'nan'", "from 0 to 1000"});
  expect_refused({"bench", "raster", "--gaussians", "0"}, {"'0'", "from 1 to 20000000"});
  expect_refused({"bench", "raster", "--pixels", "8"}, {"--pixels 8", "512x512"});
}

TEST_F(CommandTest, HelpIsThereForEveryCommand) {
  EXPECT_EQ(gflow({"--help"}).code, 0);
  EXPECT_EQ(gflow({"--version"}).code, 0);
  for (const char* command : {"train", "render", "eval", "splat", "devices"}) {
    const Outcome outcome = gflow({command, "--help"});
    EXPECT_EQ(outcome.code, 0) << command;
    EXPECT_NE(outcome.out.find("--device"), std::string::npos) << command;
    EXPECT_EQ(outcome.out.find("=[]"), std::string::npos) << command;
  }
}

TEST_F(CommandTest, AFileThatCannotBeWrittenIsOneSentenceAndLeavesNothing) {
  const TemporaryFolder folder, out;
  Arrays input = small_npz();
  input["size"] = Array{{2}, std::vector<int32_t>{160, 120}};
  write_npz(folder.file("in.npz"), input);
  const std::vector<std::string> splat{"splat", folder.file("in.npz"), "-o", out.file("out.npz")};
  const std::vector<std::string> render{"render", run(), "-o", out.path(), "--quiet"};
  const auto train = [](const std::string& folder) -> std::vector<std::string> {
    return {"train", scene().path(), "-o", folder, "--iterations", "1", "--quiet"};
  };
  // First without the limit, so that all kernels are in a cache, wherever this machine keeps its
  // own.
  const std::string cache = "export GFLOW_CACHE_DIR='" + folder.file("cache") + "'";
  const std::string limited = cache + "; ulimit -f 2";  // 1 or 2 KiB
  ASSERT_EQ(gflow(splat, cache).code, 0);
  ASSERT_EQ(gflow({"render", run(), "-o", folder.path(), "--quiet"}, cache).code, 0);
  ASSERT_EQ(gflow(train(folder.file("run")), cache).code, 0);
  fs::remove(out.file("out.npz"));
  expect_refused(splat, {"out.npz", "File too large"}, limited);
  EXPECT_EQ(out.count(), 0u);
  expect_refused(render, {"cannot write", "File too large"}, limited);
  EXPECT_EQ(out.count(), 0u);
  const std::string fresh = out.path() + "/run";
  expect_refused(train(fresh), {"cannot write", "File too large"}, limited);
  EXPECT_EQ(RunFolder(fresh).read_facts().iterations, 0);
}

TEST_F(CommandTest, AFullStandardOutputIsNoSuccess) {
  const Outcome outcome = gflow({"--help"}, "exec >/dev/full");
  EXPECT_EQ(outcome.code, 1);
  EXPECT_NE(outcome.err.find("No space left"), std::string::npos) << outcome.err;
}

TEST_F(CommandTest, CtrlCBeforeAnyWorkIsOneSentenceToo) {
  const TemporaryFolder folder;
  for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
           {"train", scene().path(), "-o", folder.path() + "/run"},
           {"devices"},
           {"bench", "raster"}}) {
    const Command command(arguments);
    command.wait_for_handler(SIGINT);
    command.send(SIGINT);
    const Outcome outcome = command.wait();
    EXPECT_EQ(outcome.code, 130) << arguments[0];
    EXPECT_EQ(outcome.err, "gflow: interrupted\n") << arguments[0];
  }
  EXPECT_FALSE(fs::exists(folder.path() + "/run"));
}

TEST_F(CommandTest, ASingleTimeHasFlowWhereTheSceneHasANextStep) {
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

TEST_F(CommandTest, CtrlCDuringTrainingLeavesTheModelOfTheStepsMade) {
  const TemporaryFolder folder;
  const std::string out = folder.path() + "/run";
  const Command command({"train", scene().path(), "-o", out, "--iterations", "100000000", "--set",
                         "train.log_every=1", "--quiet"});
  // The log's first line shows that steps are being made.
  for (int i = 0; i < 1200 && !fs::exists(out + "/metrics.jsonl"); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  command.send(SIGINT);
  const Outcome outcome = command.wait();
  EXPECT_EQ(outcome.code, 130) << outcome.err;
  EXPECT_NE(outcome.err.find("interrupted after"), std::string::npos) << outcome.err;
  const std::string model = read_run_state(RunFolder::open(out)).path;
  EXPECT_GT(read_model(model).count, 0u);
  EXPECT_NE(outcome.err.find(model), std::string::npos) << outcome.err;
  EXPECT_FALSE(fs::exists(out + "/results.json"));
}

}  // namespace
}  // namespace gflow
