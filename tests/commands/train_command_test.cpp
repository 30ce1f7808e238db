// SPDX-License-Identifier: Apache-2.0
// The gflow program as a user runs it: train and eval, messages and exit codes of every command.
#include <sys/stat.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "optim/images/movie.hpp"
#include "tests/support/command_scene.hpp"

namespace gflow {
namespace {

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

TEST_F(CommandTest, TrainTakesAQualityThatOtherOptionsOverride) {
  const TemporaryFolder folder;
  const auto trained_for = [&](const std::vector<std::string>& options) {
    std::vector<std::string> words{
        "train", scene().path(),       "-o",    folder.file("run"),  "--overwrite", "--quiet",
        "--set", "train.minutes=1e-6", "--set", "flow.enabled=false"};
    words.insert(words.end(), options.begin(), options.end());
    const Outcome outcome = gflow(words);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    TrainOptions config;
    apply_file(config, folder.file("run/config.toml"));
    return config.train.iterations;
  };
  EXPECT_EQ(trained_for({"--quality", "draft"}), 2000);
  EXPECT_EQ(trained_for({"--quality", "standard"}), TrainOptions().train.iterations);
  EXPECT_EQ(trained_for({"--quality", "best", "--iterations", "7"}), 7);
  EXPECT_EQ(trained_for({"--set", "train.iterations=9", "--quality", "best"}), 9);
  expect_refused({"train", scene().path(), "-o", folder.file("run"), "--quality", "fast"},
                 {"--quality: 'fast'", "draft, standard or best"});
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
  EXPECT_EQ(gflow({"render", run, "-o", folder.file("images"), "--quiet"}).code, 0);
  EXPECT_TRUE(fs::exists(folder.path() + "/images/compare"));
  expect_refused({"train", video, "-o", run, "-r", "3"}, {"-r,--resolution: '3'", "1, 2, 4 or 8"});
  expect_refused({"train", folder.file("none.mp4"), "-o", run, "--overwrite"},
                 {"none.mp4", "no such"});
}

TEST_F(CommandTest, WithoutTestViewsSomeTrainingViewsAreEvaluated) {
  const TemporaryFolder folder;
  const std::string run = folder.file("run");
  const Outcome outcome = gflow({"train", scene().path(), "-o", run, "--iterations", "1", "--quiet",
                                 "--set", "scene.holdout=-1", "--set", "flow.enabled=false"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.out.find("20 views, all used for training"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("PSNR"), std::string::npos) << outcome.out;
  EXPECT_NE(outcome.out.find("no test views"), std::string::npos) << outcome.out;
  EXPECT_TRUE(fs::exists(run + "/compare.png"));
  EXPECT_FALSE(fs::exists(run + "/results.json"));
}

TEST_F(CommandTest, TrainSaysWhatItFound) {
  const TemporaryFolder folder;
  const Outcome outcome = gflow({"train", scene().path(), "-o", folder.file("run"), "--iterations",
                                 "1", "--set", "flow.source=files"});
  EXPECT_NE(outcome.err.find("scene: n3v, 4 cameras, 5 time steps; images: 15 training, 5 test, 0 "
                             "validation, 48x40\n"),
            std::string::npos)
      << outcome.err;
  EXPECT_NE(outcome.err.find("initial Gaussians: 94 at the scene's points, and "),
            std::string::npos)
      << outcome.err;
  EXPECT_EQ(outcome.err.find("test views:"), std::string::npos) << outcome.err;
  EXPECT_EQ(nlohmann::json::parse(contents(folder.file("run/results.json")))["test"]["trained_on"],
            false);
  const Outcome still =
      gflow({"train", scene().path(), "-o", folder.file("still"), "--iterations", "1", "--set",
             "flow.source=files", "--set", "init.dynamic=0", "--init", "random"});
  EXPECT_NE(still.err.find(" at random positions\n"), std::string::npos) << still.err;
}

// The same images, numbered: one camera without others for a test.
TEST_F(CommandTest, TestViewsThatWereTrainedOnAreMarked) {
  const TemporaryFolder folder;
  fs::copy(scene().path() + "/cam01/images", folder.path() + "/images");
  const std::string run = folder.file("run");
  const Outcome outcome = gflow({"train", folder.path() + "/images", "-o", run, "--iterations", "1",
                                 "--set", "init.count=500"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("consistent4d, 1 camera, 5 time"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("test views: same as the training views"), std::string::npos)
      << outcome.err;
  EXPECT_NE(outcome.out.find("5 views, all used for training"), std::string::npos) << outcome.out;
  const auto results = nlohmann::json::parse(contents(run + "/results.json"));
  EXPECT_EQ(results["test"]["trained_on"], true);
}

TEST_F(CommandTest, SettingsWithoutEffectAreNamed) {
  const TemporaryFolder folder;
  const std::string cameras = run() + "/cameras.json", out = folder.path() + "/run";
  expect_refused({"train", scene().path(), "-o", out, "--cameras", cameras},
                 {"--cameras", "its own cameras (n3v)", "numbered images"});
  EXPECT_FALSE(fs::exists(out));
  const Outcome outcome =
      gflow({"train", scene().path(), "-o", out, "--iterations", "1", "--quiet", "--set",
             "scene.cameras=" + cameras, "--set", "motion.model=hexplane", "--set",
             "motion.static_threshold=0.1", "--set", "density.enabled=false", "--set",
             "flow.source=files", "--set", "flow.tracks=a.npz"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  for (const char* setting : {"scene.cameras = ", "motion.static_threshold = 0.1",
                              "density.enabled = false", "flow.tracks = "})
    EXPECT_NE(outcome.err.find(std::string("gflow: warning: ") + setting), std::string::npos)
        << setting << " in " << outcome.err;
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 4) << outcome.err;
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
  EXPECT_EQ(gflow({"eval", run, "--iteration", "3", "--quiet"}).code, 0);  // the latest state
  EXPECT_EQ(contents(run + "/results.json"), before.at("results.json"));
}

TEST_F(CommandTest, EvalFindsWhatTrainFound) {
  const auto before = nlohmann::json::parse(contents(run() + "/results.json"));
  fs::remove(run() + "/results.json");
  const Outcome outcome = gflow({"eval", run(), "--quiet"});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  for (const char* row : {"\n  PSNR ", "\n  Gaussians ", "\n  training time ", "\n  peak memory "})
    EXPECT_NE(outcome.out.find(row), std::string::npos) << row;
  const auto after = nlohmann::json::parse(contents(run() + "/results.json"));
  EXPECT_EQ(after, before);
}

// cameras.json has the cameras of the test views as they were fitted.
TEST_F(CommandTest, EvalFitsTestCamerasFromWhereTrainDid) {
  const TemporaryFolder folder;
  const std::string run = folder.file("run");
  std::vector<std::string> train{"train",   scene().path(), "-o", run,
                                 "--quiet", "--iterations", "60"};
  for (const char* set : {"cameras.refine=on", "cameras.start=0", "flow.enabled=false"})
    train.insert(train.end(), {"--set", set});
  ASSERT_EQ(gflow(train).code, 0);
  const auto metric = [&](const char* name) {
    return nlohmann::json::parse(contents(run + "/results.json"))["test"][name].get<double>();
  };
  const double psnr = metric("psnr"), unfitted = metric("psnr_unfitted");
  EXPECT_GT(psnr, unfitted + 0.01);
  train.push_back("--resume");
  for (const auto& again : {std::vector<std::string>{"eval", run, "--quiet"}, train}) {
    fs::remove(run + "/results.json");
    const Outcome outcome = gflow(again);
    ASSERT_EQ(outcome.code, 0) << outcome.err;
    // cameras.json rounds poses by 1e-16.
    EXPECT_NEAR(metric("psnr_unfitted"), unfitted, 1e-4) << again[0];
    EXPECT_NEAR(metric("psnr"), psnr, 1e-3) << again[0];
  }
}

const std::string networks = GFLOW_SOURCE_DIR "/tests/data/networks/";

TEST_F(CommandTest, WithoutANetworkEvalNamesTheSetting) {
  const Outcome outcome = gflow({"eval", run(), "--quiet"});
  EXPECT_NE(outcome.out.find("\nLPIPS needs a network: --set metrics.lpips=FILE.onnx\n"),
            std::string::npos)
      << outcome.out;
  for (const char* row : {"  LPIPS ", "  CLIP "})
    EXPECT_EQ(outcome.out.find(row), std::string::npos) << outcome.out;
  const auto test = nlohmann::json::parse(contents(run() + "/results.json"))["test"];
  for (const char* key : {"lpips", "clip", "lpips_model", "clip_model"})
    EXPECT_TRUE(test.contains(key) && test[key].is_null()) << key;
}

TEST_F(CommandTest, EvalUsesTheNetworksItIsGiven) {
  const TemporaryFolder folder;
  const std::string copy = folder.file("run");
  fs::copy(run(), copy, fs::copy_options::recursive);
  // The first path is relative to the current folder.
  const Outcome outcome = gflow({"eval", copy, "--quiet", "--set",
                                 "metrics.lpips=" + fs::relative(networks + "lpips.onnx").string(),
                                 "--set", "metrics.clip=" + networks + "clip.onnx"});
  if (outcome.err.find("libopencv-dnn-dev") != std::string::npos)
    GTEST_SKIP() << "built without OpenCV's dnn module";
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.out.find("needs a network"), std::string::npos) << outcome.out;
  for (const char* row : {"\n  LPIPS ", "\n  CLIP "})
    EXPECT_NE(outcome.out.find(row), std::string::npos) << outcome.out;
  const auto test = nlohmann::json::parse(contents(copy + "/results.json"))["test"];
  EXPECT_GT(test["lpips"], 0);
  EXPECT_GT(test["clip"], 0.5);
  EXPECT_EQ(test["lpips_model"], fs::canonical(networks + "lpips.onnx").string());
  const auto views = nlohmann::json::parse(contents(copy + "/per_view.json"));
  EXPECT_TRUE(views["cam00_0000"]["lpips"].is_number());
  EXPECT_EQ(contents(copy + "/config.toml"), contents(run() + "/config.toml"));

  // Without the setting the metrics stay; an empty setting removes them.
  const auto evaluated = [&](std::vector<std::string> more) {
    more.insert(more.begin(), {"eval", copy, "--quiet"});
    EXPECT_EQ(gflow(more).code, 0);
    return nlohmann::json::parse(contents(copy + "/results.json"))["test"];
  };
  EXPECT_EQ(evaluated({}), test);
  const auto without = evaluated({"--set", "metrics.lpips="});
  EXPECT_TRUE(without["lpips"].is_null());
  EXPECT_EQ(without["clip"], test["clip"]);

  expect_refused({"eval", copy, "--set", "metrics.lpips=no/such.onnx"}, {"no/such.onnx"});
  expect_refused({"eval", copy, "--set", "metrics.clip=" + networks + "lpips.onnx"},
                 {"metrics.clip", "lpips.onnx", "2 inputs"});
  expect_refused({"eval", copy, "--set", "flow.enabled=false"},
                 {"flow.enabled=false", "only [metrics] settings can be changed"});
  // A training that could not be evaluated does not start.
  const std::string other = folder.file("other");
  expect_refused({"train", scene().path(), "-o", other, "--iterations", "3", "--quiet", "--set",
                  "metrics.lpips=" + networks + "lpips_6x4.onnx"},
                 {"metrics.lpips", "6x4", "48x40"});
  EXPECT_FALSE(fs::exists(other));
}

TEST_F(CommandTest, ADamagedVideoIsOneSentenceOfOursAlone) {
  const TemporaryFolder folder;
  const std::string whole = contents(GFLOW_SOURCE_DIR "/apps/demo/scene/cam01.mp4");
  const std::string cut = folder.write("cut.mp4", whole.substr(0, whole.size() / 2));
  const std::string out = folder.path() + "/run";
  expect_refused({"train", cut, "-o", out},
                 {"cut.mp4: no frame could be read; the file seems cut off"});
}

TEST_F(CommandTest, TrainSaysWhatIsWrongWithTheSceneOrTheSettings) {
  const TemporaryFolder folder;
  const std::string out = folder.path() + "/run";
  expect_refused({"train", folder.path() + "/none", "-o", out}, {"/none", "no such scene folder"});
  expect_refused({"train", folder.path(), "-o", out}, {"no known scene layout"});
  expect_refused({"train", scene().path(), "-o", out, "--set", "flow.wieght=1"},
                 {"flow.wieght", "flow.weight"});
  expect_refused({"train", scene().path(), "-o", out, "--set", "flow.weight=-1"},
                 {"flow.weight", "at least 0"});
  expect_refused({"train", scene().path(), "-o", out, "--config", folder.path() + "/none.toml"},
                 {"none.toml"});
  expect_refused({"train", scene().path(), "-o", out, "--init", "visual_hull"},
                 {"--init visual_hull", "no such file",
                  "auto, points, depth, stereo, random, visual-hull, file"});
  expect_refused({"train", scene().path(), "-o", out, "--init", "file"}, {"init.file is empty"});
  expect_refused({"train", scene().path(), "-o", out, "--init", "visual-hull"}, {"no alpha"});
  fs::copy(scene().path(), folder.path() + "/tracked", fs::copy_options::recursive);
  folder.write("tracked/tracks3d.npy", "no tracks");  // read only in the final evaluation
  expect_refused({"train", folder.path() + "/tracked", "-o", out}, {"tracks3d.npy"});
  EXPECT_FALSE(fs::exists(out));
  folder.write("file", "");
  expect_refused({"train", scene().path(), "-o", folder.path() + "/file/run"}, {"file/run"});
  expect_refused({"train", scene().path(), "-o", folder.path() + "/file"},
                 {"/file: it is a file", "-o needs a folder"});
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
  TrainOptions config = RunFolder::open(copy).read_config();
  config.train.device = "no such device";
  RunFolder(copy).write_config(config);
  EXPECT_EQ(gflow({"eval", copy, "--quiet"}).code, 0);
}

TEST_F(CommandTest, AWrongCommandLineIsAnsweredWithWhatIsNearest) {
  const std::string out = "/nowhere/out";
  expect_refused({},
                 {"a command is missing",
                  "train, cameras, render, view, eval, export, info, experiment, settings, import, "
                  "splat, bench, stress, devices or completion"});
  expect_refused({"trian", "scene", "-o", out}, {"`gflow trian`", "nearest is train", "splat"});
  expect_refused({"--quiet", "device"}, {"`gflow device`", "nearest is devices"});
  expect_refused({"--device"}, {"--device", "missing", "gflow --help"});
  expect_refused({"--zzzzzz"}, {"no option --zzzzzz (see"});
  expect_refused({"bench"}, {"a command is missing", "gflow bench raster"});
  expect_refused({"bench", "rastr"}, {"`gflow bench rastr`", "raster"});
  expect_refused({"eval", run(), "--splt=test"}, {"no option --splt,", "--split", "--help"});
  expect_refused({"devices", "--jsn"}, {"--jsn", "nearest is --json"});
  expect_refused({"import", model(), "-o", out, "--overwrite"}, {"no option --overwrite (see"});
  expect_refused({"eval", run(), "more"}, {"`gflow eval`", "'more'"});
  expect_refused({"train", "scene"}, {"--output is required", "gflow train --help"});
  expect_refused({"splat", "a.npz", "-o", out, "--transport", "papr"},
                 {"--transport", "'papr'", "paper, ot, material or translate"});
  expect_refused({"splat", "a.npz", "-o", out, "--stop", "x"}, {"'x'", "include or exclude"});
  expect_refused({"splat", "a.npz", "-o", out, "--lanes", "3"}, {"'3'", "0, 1, 4, 8 or 16"});
  for (const char* command : {"train", "render", "export", "import", "experiment", "splat"})
    expect_refused({command, "some", "-o", ""}, {"--output", "the path is empty"});
  for (const char* command : {"import", "export", "render", "splat", "experiment", "train"})
    expect_refused({command, "", "-o", out}, {"the path is empty", command});
  for (const char* command : {"info", "eval"})
    expect_refused({command, ""}, {"the path is empty", command});
  expect_refused({"bench", "step", ""}, {"SCENE: the path is empty", "bench step"});
  for (const char* option : {"--json", "--plots", "--markdown"})
    expect_refused({"bench", "pareto", option, ""}, {option, "the path is empty"});
  expect_refused({"stress", "--json", ""}, {"--json", "the path is empty"});
  expect_refused({"train", "some", "-o", "out", "--config", ""}, {"--config", "the path is empty"});
  expect_refused({"train", "some", "-o", "out", "--seed", std::string(23, '9')},
                 {"--seed: '" + std::string(23, '9') + "' is not a number from 0 to 2000000000"});
  for (const char* steps : {"0", "-3", "2.5", "many"})
    expect_refused({"train", "some", "-o", "out", "--iterations", steps},
                   {fmt::format("--iterations: '{}' is not a number of training steps", steps),
                    "at least one", "whole number from 1 to 2147483647"});
  expect_refused({"render", run(), "-o", out, "--up", "w"}, {"'w'", "-y or -z"});
  expect_refused({"render", run(), "-o", out, "--fps", "nan"}, {"'nan'", "0.01 to 1000"});
  expect_refused({"render", run(), "-o", out, "--fps", "0x1p3"}, {"'0x1p3'", "0.01 to 1000"});
  expect_refused({"bench", "raster", "--gaussians", "0"}, {"'0'", "from 1 to 20000000"});
  expect_refused({"bench", "raster", "--pixels", "8"}, {"--pixels 8", "512x512"});
}

TEST_F(CommandTest, SettingsListsWhatTrainingMayBeTold) {
  const Outcome all = gflow({"settings", "--all"}), usual = gflow({"settings"});
  EXPECT_EQ(all.code, 0) << all.err;
  for (const auto& [name, value] : setting_values({}))
    EXPECT_NE(all.out.find(fmt::format("\n  {} = {}", name, value)), std::string::npos) << name;
  EXPECT_EQ(usual.out.find("adam.eps_means"), std::string::npos);
  EXPECT_NE(usual.out.find("\n  flow.weight = "), std::string::npos);
  const Outcome some = gflow({"settings", "flow.ev"});
  EXPECT_EQ(some.out.find("[flow]  optical flow\n  flow.every = "), 0u) << some.out;
  EXPECT_EQ(some.out.find(" = ", some.out.find(" = ") + 1), std::string::npos) << some.out;
  const auto json = nlohmann::json::parse(gflow({"settings", "skip.", "--json"}).out);
  EXPECT_EQ(json["skip.masks"]["default"], "true");
  EXPECT_EQ(json["skip.masks"]["allowed"], "true or false");
  EXPECT_FALSE(json.contains("flow.every"));
  expect_refused({"settings", "wieght"}, {"settings wieght: no setting", "weight"});
  for (const char* word : {"nosuch", "motion.nosuch"})
    expect_refused({"settings", word}, {"no setting has this in its name; `gflow settings --all`"});
}

TEST_F(CommandTest, SettingsEndsWithHowManyOfAllItShows) {
  const size_t total = setting_values({}).size();
  const auto ends_with = [](const std::string& text, const std::string& end) {
    EXPECT_EQ(text.substr(text.size() - std::min(text.size(), end.size())), end);
  };
  const std::vector<SettingInWords> all = settings_in_words({});
  const auto usual =
      std::count_if(all.begin(), all.end(), [](const auto& setting) { return !setting.advanced; });
  ends_with(gflow({"settings"}).out,
            fmt::format("\n{} of {} settings; --all shows the rest\n", usual, total));
  ends_with(gflow({"settings", "--all"}).out, fmt::format("\n{0} of {0} settings\n", total));
  ends_with(gflow({"settings", "flow.ev"}).out, fmt::format("\n1 of {} settings\n", total));
}

TEST_F(CommandTest, SettingsIsWrappedBelowItsColumns) {
  const Outcome outcome = gflow({"settings", "--all"}, "export COLUMNS=80");
  std::istringstream lines(outcome.out);
  for (std::string line; std::getline(lines, line);) {
    EXPECT_LE(line.size(), 80u) << line;
    const size_t indent = line.find_first_not_of(' ');
    EXPECT_TRUE(line.empty() || indent == 0 || indent == 2 || indent == 34) << line;
  }
}

TEST_F(CommandTest, HelpIsThereForEveryCommand) {
  EXPECT_EQ(gflow({"--help"}).code, 0);
  const Outcome version = gflow({"--version"});
  EXPECT_EQ(version.code, 0);
  for (const char* part : {"gflow ", "(commit ", "OpenCL", "OpenCV", "FFmpeg", "networks"})
    EXPECT_NE(version.out.find(part), std::string::npos) << version.out;
  for (const char* command : {"train", "render", "eval", "splat", "devices"}) {
    const Outcome outcome = gflow({command, "--help"});
    EXPECT_EQ(outcome.code, 0) << command;
    EXPECT_NE(outcome.out.find("--device"), std::string::npos) << command;
    EXPECT_EQ(outcome.out.find("=[]"), std::string::npos) << command;
  }
}

TEST_F(CommandTest, HelpIsWrappedToTheWidthOfTheTerminal) {
  for (const char* command : {"train", "render", "eval", "export", "settings", "splat", "bench"})
    for (const size_t width : {70, 90}) {
      const Outcome outcome = gflow({command, "--help"}, fmt::format("export COLUMNS={}", width));
      std::istringstream lines(outcome.out);
      for (std::string line; std::getline(lines, line);) EXPECT_LE(line.size(), width) << line;
    }
}

// An unknown name would silently produce no gradients.
TEST_F(CommandTest, ACotangentOfAnUnknownNameIsRefused) {
  const TemporaryFolder folder;
  Arrays input = small_npz();
  input["v_rbg"] = input.count("v_rgb") ? input["v_rgb"] : Array{{1}, std::vector<float>{0}};
  write_npz(folder.file("in.npz"), input);
  expect_refused({"splat", folder.file("in.npz"), "-o", folder.file("out.npz")},
                 {"in.npz", "'v_rbg'", "v_rgb, v_alpha, v_depth and v_flow"});
  EXPECT_EQ(folder.count(), 1u);
}

// A library or a user may abort the program: it ends with a message.
TEST(Abort, EndsTheProgramWithASentence) {
  const Command stress({"stress", "--only", "T40"});
  for (int i = 0; i < 6000 && stress.said().empty(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  stress.send(SIGABRT);
  const Outcome outcome = stress.wait();
  EXPECT_EQ(outcome.code, 128 + SIGABRT);
  EXPECT_NE(outcome.err.find("gflow: a library or the OpenCL driver aborted"), std::string::npos)
      << outcome.err;
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
  // First without the limit, so that all kernels are in a cache, wherever the default cache is.
  const std::string cache = "export GFLOW_CACHE_DIR='" + folder.file("cache") + "'";
  const std::string limited = cache + "; ulimit -f 2";  // 1 or 2 KiB
  ASSERT_EQ(gflow(splat, cache).code, 0);
  ASSERT_EQ(gflow({"render", run(), "-o", folder.file("drawn"), "--quiet"}, cache).code, 0);
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
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"--help"}, {"--version"}, {"settings"}, {"settings", "--json"}})
    for (const auto& [first, why] : {std::pair("exec >/dev/full", "No space left on device"),
                                     {"exec >&-", "Bad file descriptor"}}) {
      const Outcome outcome = gflow(words, first);
      EXPECT_EQ(outcome.code, 1) << words[0];
      EXPECT_EQ(outcome.err, fmt::format("gflow: cannot write to standard output: {}\n", why));
    }
}

// The reader of a pipe may exit at any time, as `head` does.
TEST_F(CommandTest, NobodyWhoReadsIsNoReasonForWords) {
  const TemporaryFolder folder;
  const std::string pipe = folder.file("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  // A shell opens both ends and closes the reading one.
  const Outcome outcome = gflow({"settings"}, "exec 3<>'" + pipe + "' 1>'" + pipe + "' 3<&-");
  EXPECT_EQ(outcome.code, 128 + SIGPIPE);
  EXPECT_EQ(outcome.err, "");
}

// Notices and progress are discarded; they must not end up in a file that reuses the descriptor of
// stderr.
TEST_F(CommandTest, WithoutStandardStreamsATrainingIsTheSame) {
  const TemporaryFolder folder;
  const auto trained = [&](const std::string& name, const std::string& first) {
    const std::string out = folder.path() + "/" + name;
    const Outcome outcome = gflow(
        {"train", scene().path(), "-o", out, "--iterations", "2", "--set", "flow.enabled=false"},
        first);
    EXPECT_EQ(outcome.code, 0) << name << " " << outcome.err;
    EXPECT_LT(contents(out + "/.lock").size(), 12u) << contents(out + "/.lock");
    return contents(out + "/point_cloud/iteration_2/point_cloud.ply");
  };
  const std::string expected = trained("plain", "");
  EXPECT_TRUE(trained("full", "exec 2>/dev/full") == expected);
  EXPECT_TRUE(trained("closed", "exec 2>&-") == expected);
  EXPECT_TRUE(trained("all closed", "exec 0<&- 2>&-") == expected);
  const std::string pipe = folder.file("pipe");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  EXPECT_TRUE(trained("unread", "exec 3<>'" + pipe + "' 2>'" + pipe + "' 3<&-") == expected);
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

TEST_F(CommandTest, CtrlCDuringTrainingLeavesTheModelOfTheStepsMade) {
  const TemporaryFolder folder;
  const std::string out = folder.path() + "/run";
  const Command command({"train", scene().path(), "-o", out, "--iterations", "100000000", "--set",
                         "train.log_every=1", "--quiet"});
  // The first line of the log shows that training has started.
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

// For an empty list the parser takes the next argument.
TEST(CommandLine, ListsAndOptionsGivenTwiceAreToldInOneSentence) {
  expect_refused({"stress", "--only", ",", "--json", "x"},
                 {"--only: '--json' is an option", "a list entry is expected"});
  expect_refused({"bench", "raster", "--gaussians", "-5"}, {"--gaussians", "-5"});
  expect_refused({"train", "x", "-o", "y", "--iterations", "3", "--iterations", "4"},
                 {"--iterations is given twice"});
}

TEST(CommandLine, AnOptionIsNamedAsItMayHaveBeenTyped) {
  expect_refused({"train", "x", "-o", "y", "-r", "two"}, {"gflow: -r,--resolution: 'two'"});
  expect_refused({"render", "x", "-o", "y", "-r", "3"}, {"gflow: -r,--resolution: '3'"});
  expect_refused({"train", "x", "-o", "y", "-o", "z"}, {"gflow: -o,--output is given twice"});
  expect_refused({"train", "x"}, {"gflow: -o,--output is required"});
}

}  // namespace
}  // namespace gflow
