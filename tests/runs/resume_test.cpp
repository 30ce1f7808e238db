// SPDX-License-Identifier: Apache-2.0
// Trainings that are stopped in every way and resumed. tests/kill_and_resume does the same at
// random moments.
#include <map>
#include <nlohmann/json.hpp>

#include "tests/support/command.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

// A scene and an uninterrupted run, without intermediate checkpoints.
class Resume : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    Queue queue = test_queue();
    scene_ = new SmallScene(queue);
    folder_ = new TemporaryFolder;
    write_config();
    ASSERT_EQ(gflow(train("whole", {"--set", "train.checkpoint_every=0"})).code, 0);
  }
  static void TearDownTestSuite() {
    delete scene_;
    delete folder_;
  }
  void SetUp() override { fs::remove_all(run("run")); }

  static std::string run(const std::string& name) { return folder_->path() + "/" + name; }
  static std::vector<std::string> train(const std::string& name,
                                        const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"train",    scene_->path(),     "-o",     run(name),
                                       "--config", run("config.toml"), "--quiet"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  static std::vector<std::string> resume(const std::vector<std::string>& more = {}) {
    std::vector<std::string> arguments{"train", "-o", run("run"), "--resume", "--quiet"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return arguments;
  }
  static std::string checkpoint(int step) { return RunFolder(run("run")).checkpoints().path(step); }

  // A run that this signal ends right after its checkpoint of this step.
  static Outcome stopped_after(int step, int signal) {
    const Command command(train("run"));
    EXPECT_TRUE(wait_until([&] { return fs::exists(checkpoint(step)); }));
    command.send(signal);
    return command.wait();
  }
  static std::string latest_model(const std::string& name) {
    const RunFolder folder(run(name));
    return folder.model_path(folder.models().at(0));
  }
  // The files of a run, except times.
  static std::vector<std::string> left_in(const std::string& name) {
    std::vector<std::string> left{contents(latest_model(name)),
                                  contents(run(name) + "/per_view.json")};
    std::ifstream metrics(run(name) + "/metrics.jsonl");
    for (std::string line; std::getline(metrics, line);) {
      const size_t seconds = line.find("\"seconds\"");
      left.push_back(line.erase(seconds, line.find(',', seconds) - seconds));
    }
    return left;
  }
  static void expect_as_uninterrupted() {
    EXPECT_TRUE(left_in("run") == left_in("whole"));
    size_t unfinished = 0;
    for (const auto& entry : fs::recursive_directory_iterator(run("run")))
      unfinished += is_temporary_name(entry.path().filename().string());
    EXPECT_EQ(unfinished, 0u);
  }

  static SmallScene* scene_;
  static constexpr const char* flow_of_one_ = "cam01/0001.flo";

 private:
  static void write_config() {
    TrainOptions config = small_config(*scene_, 240);
    config.train.log_every = 10;
    config.train.checkpoint_every = 20;
    config.loss.velocity = 0.01f;  // not active in every step
    folder_->write("config.toml", to_toml(config));
  }
  static TemporaryFolder* folder_;
};
SmallScene* Resume::scene_ = nullptr;
TemporaryFolder* Resume::folder_ = nullptr;

TEST_F(Resume, CheckpointsChangeNoBitOfTheTraining) {
  ASSERT_EQ(gflow(train("run")).code, 0);
  expect_as_uninterrupted();
}

TEST_F(Resume, AKilledTrainingGoesOnAsIfNothingHadHappened) {
  EXPECT_EQ(stopped_after(40, SIGKILL).code, 128 + SIGKILL);
  // As if it was killed within a log line and within its next checkpoint.
  std::ofstream(run("run") + "/metrics.jsonl", std::ios::app) << "{\"iteration\":5";
  std::ofstream(run("run") + "/checkpoints/.iteration_60.77-0.part.npz") << "PK";
  const Outcome outcome = gflow(resume());
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  expect_as_uninterrupted();
}

TEST_F(Resume, ATrainingKilledTwiceGoesOn) {
  EXPECT_EQ(stopped_after(20, SIGKILL).code, 128 + SIGKILL);
  const Command command(resume());
  EXPECT_TRUE(wait_until([&] { return fs::exists(checkpoint(160)); }));
  command.send(SIGKILL);
  command.wait();
  EXPECT_EQ(gflow(resume()).code, 0);
  expect_as_uninterrupted();
}

TEST_F(Resume, ATrainingKilledBeforeItsFirstCheckpointStartsAgain) {
  const Command command(train("run"));
  EXPECT_TRUE(wait_until([&] { return fs::exists(run("run") + "/config.toml"); }));
  command.send(SIGKILL);
  command.wait();
  fs::remove_all(run("run") + "/checkpoints");  // one may exist already
  EXPECT_EQ(gflow(resume()).code, 0);
  expect_as_uninterrupted();
}

TEST_F(Resume, AnInterruptedTrainingSavesFirstAndSaysHowToGoOn) {
  for (const int signal : {SIGINT, SIGTERM}) {
    fs::remove_all(run("run"));
    const Outcome outcome = stopped_after(40, signal);
    EXPECT_EQ(outcome.code, 128 + signal) << outcome.err;
    EXPECT_NE(outcome.err.find("`gflow train -o " + run("run") + " --resume`"), std::string::npos)
        << outcome.err;
    const int steps = RunFolder(run("run")).read_facts().iterations;
    EXPECT_TRUE(fs::exists(checkpoint(steps))) << steps;
    EXPECT_EQ(gflow(resume()).code, 0);
    expect_as_uninterrupted();
  }
}

TEST_F(Resume, AFinishedTrainingIsEvaluatedAgainAndNothingElse) {
  ASSERT_EQ(gflow(train("run")).code, 0);
  fs::remove(run("run") + "/results.json");
  EXPECT_EQ(gflow(resume()).code, 0);
  EXPECT_TRUE(fs::exists(run("run") + "/results.json"));
  expect_as_uninterrupted();
}

// As after a full disk at the end: a job that is restarted repeatedly must terminate.
TEST_F(Resume, AModelThatHadNoRoomForItsCheckpointIsEvaluated) {
  ASSERT_EQ(gflow(train("run")).code, 0);
  const std::string results = run("run") + "/results.json", before = contents(results);
  const std::string model = contents(latest_model("run"));
  fs::remove_all(run("run") + "/checkpoints");
  fs::remove(results);
  expect_refused(resume({"--set", "flow.weight=0.3"}), {"gflow eval", "no checkpoint"});
  const Outcome outcome = gflow(resume());
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(contents(results), before);
  EXPECT_TRUE(contents(latest_model("run")) == model);
}

TEST_F(Resume, TheCheckpointBeforeADamagedOneIsUsed) {
  stopped_after(60, SIGKILL);
  const auto found = RunFolder(run("run")).checkpoints().latest();
  std::fstream file(found->path, std::ios::in | std::ios::out | std::ios::binary);
  file.seekp(2000).write("damage", 6);
  file.close();
  const Outcome outcome = gflow(resume());
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("warning: "), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find(found->path), std::string::npos) << outcome.err;
  expect_as_uninterrupted();
}

TEST_F(Resume, SettingsThatChangeTheResultAreRefusedOthersAreNot) {
  stopped_after(20, SIGKILL);
  expect_refused(resume({"--set", "flow.weight=0.3"}), {"flow.weight", "0.05", "0.3"});
  expect_refused(resume({"--iterations", "300"}), {"train.iterations", "240", "300"});
  expect_refused(resume({"--seed", "4"}), {"train.seed"});
  const Outcome outcome =
      gflow(resume({"--set", "train.checkpoint_every=7", "--set", "train.minutes=60"}));
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  expect_as_uninterrupted();
}

TEST_F(Resume, OtherNetworksMayEvaluateTheResult) {
  stopped_after(20, SIGKILL);
  const Outcome outcome =
      gflow(resume({"--set", "metrics.clip=" GFLOW_SOURCE_DIR "/tests/data/networks/clip.onnx"}));
  if (outcome.err.find("libopencv-dnn-dev") != std::string::npos)
    GTEST_SKIP() << "built without OpenCV's dnn module";
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(contents(run("run") + "/per_view.json").find("\"clip\": 0."), std::string::npos);
  EXPECT_TRUE(contents(latest_model("run")) == contents(latest_model("whole")));
  EXPECT_EQ(gflow(resume({"--set", "metrics.clip="})).code, 0);  // removes the network
  expect_as_uninterrupted();
}

TEST_F(Resume, ASceneMayMoveButNotChange) {
  stopped_after(20, SIGKILL);
  const std::string moved = run("moved");
  fs::copy(scene_->path(), moved, fs::copy_options::recursive);
  std::ofstream(moved + "/cam01/images/0001.png", std::ios::app) << "more";
  expect_refused({"train", moved, "-o", run("run"), "--resume", "--quiet"},
                 {moved, "cameras or images"});
  fs::copy(scene_->path(), moved,
           fs::copy_options::recursive | fs::copy_options::overwrite_existing);
  EXPECT_EQ(gflow({"train", moved, "-o", run("run"), "--resume", "--quiet"}).code, 0);
  expect_as_uninterrupted();
}

TEST_F(Resume, ASecondProcessIsRefused) {
  const Command command(train("run", {"--iterations", "100000000"}));
  EXPECT_TRUE(wait_until([&] { return fs::exists(checkpoint(20)); }));
  for (const auto& arguments : {train("run"), resume()})
    expect_refused(arguments, {run("run"), "being written by process"});
  command.send(SIGINT);
  EXPECT_EQ(command.wait().code, 130);
}

// For a run that another process trains, metrics are printed but not written; everything else is
// read-only.
TEST_F(Resume, ATrainingIsInspectedWhileItRuns) {
  const Command command(train("run", {"--iterations", "100000000"}));
  EXPECT_TRUE(wait_until([&] { return fs::exists(checkpoint(20)); }));
  const Outcome evaluated = gflow({"eval", run("run"), "--quiet"});
  EXPECT_EQ(evaluated.code, 0) << evaluated.err;
  EXPECT_NE(evaluated.out.find(" of 100000000, from the checkpoint"), std::string::npos)
      << evaluated.out;
  EXPECT_NE(evaluated.out.find("PSNR"), std::string::npos) << evaluated.out;
  EXPECT_NE(evaluated.out.find("not written"), std::string::npos) << evaluated.out;
  EXPECT_FALSE(fs::exists(run("run") + "/results.json"));
  const std::string out = run("out");
  for (const std::vector<std::string>& arguments :
       std::vector<std::vector<std::string>>{{"info", run("run")},
                                             {"render", run("run"), "-o", out, "--quiet"},
                                             {"export", run("run"), "-o", out + "/now.ply"}}) {
    const Outcome outcome = gflow(arguments);
    EXPECT_EQ(outcome.code, 0) << arguments[0] << ": " << outcome.err;
    EXPECT_EQ(outcome.err, "") << arguments[0];
    EXPECT_NE(outcome.out.find("of 100000000, from the checkpoint"), std::string::npos);
  }
  command.send(SIGINT);
  EXPECT_EQ(command.wait().code, 130);
}

TEST_F(Resume, AKilledTrainingIsEvaluatedAndGoesOnAllTheSame) {
  stopped_after(40, SIGKILL);
  const auto info = nlohmann::json::parse(gflow({"info", run("run"), "--json"}).out);
  EXPECT_EQ(info["format"], "checkpoint");
  const int step = info["iterations"];
  EXPECT_GE(step, 40);
  const Outcome evaluated = gflow({"eval", run("run"), "--quiet"});
  EXPECT_EQ(evaluated.code, 0) << evaluated.err;
  const auto results = nlohmann::json::parse(contents(run("run") + "/results.json"));
  EXPECT_EQ(results["iterations"], step);
  EXPECT_GT(results["train_seconds"], 0);
  EXPECT_EQ(results["num_gaussians"], info["gaussians"]);
  EXPECT_TRUE(results["peak_memory_mib"].is_null());
  // Results do not show that the training was finished.
  expect_refused(train("run"), {"was stopped at step " + std::to_string(step)});
  EXPECT_EQ(gflow(resume()).code, 0);
  expect_as_uninterrupted();
  const auto whole = nlohmann::json::parse(contents(run("run") + "/results.json"));
  EXPECT_EQ(whole["iterations"], 240);
}

TEST_F(Resume, PointCloudsOnTheWayAreKeptAndShown) {
  ASSERT_EQ(gflow(train("run", {"--save-every", "100"})).code, 0);
  expect_as_uninterrupted();
  EXPECT_EQ(RunFolder(run("run")).models(), (std::vector<int>{240, 200, 100}));
  const auto info =
      nlohmann::json::parse(gflow({"info", run("run"), "--json", "--iteration", "100"}).out);
  EXPECT_EQ(info["state"], "iteration 100 of 240, from its point cloud");
  const Outcome evaluated = gflow({"eval", run("run"), "--quiet", "--iteration", "100"});
  EXPECT_NE(evaluated.out.find("iteration 100 of 240"), std::string::npos) << evaluated.out;
  const std::string early = run("run") + "/results_iteration_100.json";
  EXPECT_EQ(nlohmann::json::parse(contents(early))["iterations"], 100);
  for (const char* command : {"render", "export"})
    expect_refused({command, run("run"), "-o", run("out.ply"), "--iteration", "7"},
                   {"iteration 7", "100, 200, 220, 240"});
  // A new training removes them, because they belong to another run.
  ASSERT_EQ(gflow(train("run", {"--iterations", "1", "--overwrite"})).code, 0);
  EXPECT_EQ(RunFolder(run("run")).models(), std::vector<int>{1});
}

TEST_F(Resume, PointCloudsOnTheWaySurviveAStop) {
  const Command command(train("run", {"--save-every", "30"}));
  EXPECT_TRUE(wait_until([&] { return fs::exists(checkpoint(80)); }));
  command.send(SIGINT);
  command.wait();
  EXPECT_EQ(gflow(resume()).code, 0);
  expect_as_uninterrupted();
  EXPECT_EQ(RunFolder(run("run")).models(),
            (std::vector<int>{240, 210, 180, 150, 120, 90, 60, 30}));
}

TEST_F(Resume, TheCheckpointKnowsTheSettingsWhereTheirFileIsDamaged) {
  stopped_after(40, SIGKILL);
  const std::string file = run("run") + "/config.toml", whole = contents(file);
  for (const char* damage : {"[train]\niterations = ", ""}) {
    fs::remove(file);
    if (*damage) std::ofstream(file) << damage;
    const Command command(resume());
    EXPECT_TRUE(wait_until([&] { return contents(file) == whole; }));
    command.send(SIGKILL);
    const std::string said = command.wait().err;
    EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
    EXPECT_NE(said.find("config.toml"), std::string::npos) << said;
    EXPECT_NE(said.find("using the settings saved in"), std::string::npos) << said;
  }
  EXPECT_EQ(gflow(resume()).code, 0);
  expect_as_uninterrupted();
}

// Images large enough for flow and evaluation to take time, and as many training steps as flow
// pairs: with fewer, flow would be computed on demand.
class SlowTraining : public Resume {
 protected:
  static void SetUpTestSuite() {
    Resume::SetUpTestSuite();
    Queue queue = test_queue();
    large_ = new SmallScene(queue, false, 400, 320);
  }
  static void TearDownTestSuite() {
    delete large_;
    Resume::TearDownTestSuite();
  }
  // Trains on it and sends the signal once `file` of the run exists.
  static Outcome stopped_at(const std::string& file, int signal) {
    const Command command({"train", large_->path(), "-o", run("run"), "--quiet", "--iterations",
                           "12", "--set", "init.dynamic=0"});
    EXPECT_TRUE(wait_until([&] { return fs::exists(run("run") + "/" + file); })) << file;
    command.send(signal);
    const auto start = std::chrono::steady_clock::now();
    const Outcome outcome = command.wait();
    EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(2)) << file;
    EXPECT_EQ(outcome.code, 128 + signal) << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    for (const auto& entry : fs::recursive_directory_iterator(run("run")))
      EXPECT_FALSE(is_temporary_name(entry.path().filename().string())) << entry.path();
    return outcome;
  }
  static SmallScene* large_;
};
SmallScene* SlowTraining::large_ = nullptr;

TEST_F(SlowTraining, WhileFlowIsComputedItSaysSoAndGoesOnThere) {
  const Outcome outcome = stopped_at("flow", SIGTERM);
  EXPECT_NE(outcome.err.find("while computing optical flow; `gflow train -o " + run("run")),
            std::string::npos)
      << outcome.err;
  EXPECT_EQ(gflow(resume()).code, 0);
  EXPECT_EQ(RunFolder(run("run")).read_facts().iterations, 12);
}

TEST_F(SlowTraining, WhileItEvaluatesItHasTheModelAlready) {
  const Outcome outcome = stopped_at("test/cam00_0000.png", SIGINT);
  EXPECT_NE(outcome.err.find("while evaluating; the model is in"), std::string::npos)
      << outcome.err;
  EXPECT_FALSE(fs::exists(run("run") + "/results.json"));
  EXPECT_EQ(gflow({"eval", run("run"), "--quiet"}).code, 0);
  const std::string evaluated = contents(run("run") + "/results.json");
  EXPECT_EQ(gflow(resume()).code, 0);
  EXPECT_EQ(nlohmann::json::parse(contents(run("run") + "/results.json"))["test"],
            nlohmann::json::parse(evaluated)["test"]);
}

TEST_F(Resume, WithoutARunTheSceneIsNeeded) {
  expect_refused(resume(), {run("run"), "no config.toml", "gflow train SCENE"});
  expect_refused({"train", "-o", run("run")}, {"SCENE is required"});
}

TEST_F(Resume, AStoppedTrainingIsReplacedOnRequestOnly) {
  stopped_after(60, SIGKILL);
  const Outcome rejected = gflow(train("run", {"--iterations", "1", "--seed", "5"}));
  EXPECT_EQ(rejected.code, 1);
  EXPECT_NE(rejected.err.find("was stopped at step 60 of 240"), std::string::npos) << rejected.err;
  ASSERT_TRUE(fs::exists(checkpoint(60)));
  EXPECT_EQ(gflow(train("run", {"--iterations", "1", "--seed", "5", "--overwrite"})).code, 0);
  EXPECT_FALSE(fs::exists(checkpoint(60)));
  EXPECT_TRUE(fs::exists(checkpoint(1)));
}

TEST_F(Resume, AWrongInputLeavesTheFormerRunAsItWas) {
  ASSERT_EQ(gflow(train("run")).code, 0);
  const auto before = fs::last_write_time(run("run") + "/config.toml");
  const auto expect_left_alone = [&](std::vector<std::string> with,
                                     std::initializer_list<std::string> parts) {
    with.insert(with.end(), {"--overwrite", "--set", "flow.source=dis"});  // would be computed
    expect_refused(train("run", with), parts);
    EXPECT_EQ(fs::last_write_time(run("run") + "/config.toml"), before);
    for (const char* name :
         {"results.json", "test", "point_cloud/iteration_240", "input.ply", "metrics.csv"})
      EXPECT_TRUE(fs::exists(run("run") + "/" + name)) << name;
    EXPECT_TRUE(fs::exists(checkpoint(240)));
    EXPECT_FALSE(fs::exists(run("run") + "/flow"));
  };
  expect_left_alone({"--set", "flow.folder=/nowhere", "--set", "flow.pairs=time"}, {"flow.pairs"});
  expect_left_alone({"--set", "motion.model=bases", "--set", "train.sequential=true"},
                    {"train.sequential", "motion.model"});
  expect_left_alone({"--init", "visual-hull"}, {"init.from", "no alpha"});
  for (const std::string& first : {latest_model("run"), run("run") + "/input.ply"})
    expect_left_alone({"--init", first},
                      {"training on " + first, "would remove or replace it", "copy"});

  const std::string damaged = run("damaged"), image = damaged + "/cam01/images/0001.png";
  fs::copy(scene_->path(), damaged, fs::copy_options::recursive);
  fs::permissions(image, fs::perms::owner_write, fs::perm_options::add);
  fs::resize_file(image, fs::file_size(image) / 2);
  expect_refused({"train", damaged, "-o", run("run"), "--quiet", "--overwrite"},
                 {image, "truncated"});
  EXPECT_EQ(fs::last_write_time(run("run") + "/config.toml"), before);
  EXPECT_TRUE(fs::exists(checkpoint(240)) && fs::exists(run("run") + "/results.json"));
}

// Replacing frames/ and test/ would remove the scene.
TEST_F(Resume, ASceneAmongWhatARunReplacesIsLeftAlone) {
  ASSERT_EQ(gflow(train("run", {"--iterations", "1"})).code, 0);
  const std::string test = run("run") + "/test", frames = run("run") + "/frames/cam01";
  const std::string link = run("link");
  fs::create_directories(run("run") + "/frames");
  fs::copy(scene_->path() + "/cam01/images", frames);
  fs::create_directory_symlink(test, link);
  const std::string before = contents(test + "/cam00_0000.png");
  for (const std::string& scene : {frames, test, link})
    for (const char* how : {"--overwrite", "--resume"})
      expect_refused(
          {"train", scene, "-o", run("run"), "--quiet", "--set", "flow.enabled=false", how},
          {"training on " + scene, "another output folder", "copy"});
  expect_refused(train("run", {"--overwrite", "--set", "metrics.lpips=" + test + "/lpips.onnx"}),
                 {"training on " + test + "/lpips.onnx", "another output folder"});
  EXPECT_TRUE(fs::exists(frames + "/0001.png"));
  EXPECT_TRUE(contents(test + "/cam00_0000.png") == before);
}

// As if checkpoints and models were removed to save space.
TEST_F(Resume, ResultsAloneAreNotReplacedUnasked) {
  ASSERT_EQ(gflow(train("run", {"--iterations", "1"})).code, 0);
  for (const char* name : {"checkpoints", "point_cloud"}) fs::remove_all(run("run") + "/" + name);
  const std::string results = run("run") + "/results.json", before = contents(results);
  expect_refused(train("run", {"--iterations", "2"}),
                 {run("run") + " holds results of a training", "--overwrite"});
  EXPECT_TRUE(contents(results) == before);
  // Nor on request, before the first step.
  fs::remove(run("run") + "/cameras.json");
  fs::create_directory(run("run") + "/cameras.json");
  expect_refused(train("run", {"--iterations", "2", "--overwrite"}),
                 {"cameras.json", "the previous run is unchanged"});
  EXPECT_TRUE(contents(results) == before);
  fs::remove(run("run") + "/cameras.json");
  EXPECT_EQ(gflow(train("run", {"--iterations", "2", "--overwrite"})).code, 0);
  EXPECT_NE(contents(results), before);
}

// Its time is over before the first step, which would replace the previous run by a model of no
// step.
TEST_F(Resume, AFormerRunIsNotGivenUpForNoStep) {
  ASSERT_EQ(gflow(train("run", {"--iterations", "2"})).code, 0);
  const std::vector<std::string> no_time{"--iterations", "3", "--overwrite", "--set",
                                         "train.minutes=1e-9"};
  EXPECT_EQ(gflow(train("run", no_time)).code, 0);
  EXPECT_EQ(RunFolder(run("run")).models(), std::vector<int>{1});
}

// The first step succeeds, but the initial files cannot be written.
TEST_F(Resume, AFormerRunStaysWhereTheNextCannotBegin) {
  for (const char* name : {"cameras.json", "config.toml"}) {
    fs::remove_all(run("run"));
    ASSERT_EQ(gflow(train("run", {"--iterations", "1"})).code, 0);
    fs::remove(run("run") + "/" + name);
    fs::create_directory(run("run") + "/" + name);
    const std::string before = contents(checkpoint(1));
    expect_refused(train("run", {"--iterations", "2", "--overwrite"}),
                   {std::string("run/") + name + ": ", "the previous run is unchanged"});
    EXPECT_TRUE(contents(checkpoint(1)) == before);
    for (const char* left : {"results.json", "compare.png", "input.ply", "metrics.jsonl"})
      EXPECT_TRUE(fs::exists(run("run") + "/" + left)) << left;
  }
}

// As on a failing disk: the steps made so far are saved.
TEST_F(Resume, AFlowThatCannotBeReadLosesNoStep) {
  const std::string flow = run("flow"), one = flow + "/" + flow_of_one_;
  const std::string whole = contents(scene_->path() + "/flow/" + flow_of_one_);
  fs::remove_all(flow);
  fs::copy(scene_->path() + "/flow", flow, fs::copy_options::recursive);
  std::vector<std::string> arguments =
      train("run", {"--set", "flow.folder=" + flow, "--set", "train.checkpoint_every=0"});
  fs::resize_file(one, whole.size() - 3);
  const Outcome outcome = gflow(arguments);
  EXPECT_EQ(outcome.code, 1);
  EXPECT_NE(outcome.err.find(flow_of_one_), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find("steps are saved, `gflow train"), std::string::npos) << outcome.err;
  std::ofstream(one, std::ios::binary) << whole;
  EXPECT_EQ(gflow(resume()).code, 0);
  expect_as_uninterrupted();
  // Damaged flow must not replace an existing training.
  fs::resize_file(one, whole.size() - 3);
  arguments.push_back("--overwrite");
  expect_refused(arguments, {flow_of_one_});
  expect_as_uninterrupted();
}

TEST_F(Resume, FlowOfTheUserInTheRunIsNotRemoved) {
  const std::string kept = run("run") + "/flow/kept";
  fs::create_directories(kept);
  fs::copy(scene_->path() + "/flow", kept, fs::copy_options::recursive);
  std::ofstream(run("run") + "/caches.stamp") << "of a run";
  expect_refused(train("run", {"--set", "flow.folder=" + kept}),
                 {kept, "would remove or replace it"});
  EXPECT_TRUE(fs::exists(kept + "/" + flow_of_one_));
}

TEST_F(Resume, CheckpointsOnADiskThatIsAwayAreNotDoneWithout) {
  ASSERT_EQ(gflow(train("run", {"--iterations", "1"})).code, 0);
  fs::rename(run("run") + "/checkpoints", run("scratch"));
  fs::create_directory_symlink(run("scratch"), run("run") + "/checkpoints");
  EXPECT_EQ(gflow(train("run", {"--iterations", "2", "--overwrite"})).code, 0);
  EXPECT_TRUE(fs::exists(run("scratch") + "/iteration_2.npz"));
  fs::rename(run("scratch"), run("unmounted"));
  for (const char* start : {"--resume", "--overwrite"})
    expect_refused(train("run", {"--iterations", "3", start}), {"is a link to", run("scratch")});
  EXPECT_TRUE(fs::is_symlink(run("run") + "/checkpoints"));
  EXPECT_EQ(gflow({"info", run("run")}).code, 0);
}

// Like a job that is restarted repeatedly.
TEST_F(Resume, AFinishedTrainingKeepsItsResults) {
  ASSERT_EQ(gflow(train("run", {"--iterations", "2"})).code, 0);
  ASSERT_EQ(gflow({"eval", run("run"), "--split", "train", "--quiet"}).code, 0);
  std::map<std::string, std::string> before;
  const std::string model = "point_cloud/iteration_2/point_cloud.ply";
  for (const std::string& name : std::vector<std::string>{
           "results.json", "results_train.json", "per_view_train.json", "per_view.json",
           "compare.png", "test/cam00_0000.png", "checkpoints/iteration_2.npz", "training.json",
           "metrics.csv", model})
    before[name] = contents(run("run") + "/" + name);
  EXPECT_EQ(gflow(train("run", {"--iterations", "2", "--resume"})).code, 0);
  for (const auto& [name, bytes] : before)
    EXPECT_TRUE(contents(run("run") + "/" + name) == bytes) << name;
  // A damaged model is written again.
  fs::resize_file(run("run") + "/" + model, 5000);
  EXPECT_EQ(gflow(train("run", {"--iterations", "2", "--resume"})).code, 0);
  EXPECT_TRUE(contents(run("run") + "/" + model) == before[model]);
}

// --resume evaluates it if it is known to be finished.
TEST_F(Resume, AModelWithoutItsCheckpointIsNeitherReplacedNorGoneOnWith) {
  ASSERT_EQ(gflow(train("run", {"--iterations", "1"})).code, 0);
  fs::remove_all(run("run") + "/checkpoints");
  const auto needles = {run("run"), std::string("`gflow eval"), std::string("no checkpoint")};
  expect_refused(train("run", {"--iterations", "1"}), needles);
  fs::remove(run("run") + "/training.json");
  expect_refused(train("run", {"--iterations", "1", "--resume"}), needles);
}

// A mistyped -o, or the same command again.
TEST_F(Resume, AFinishedTrainingIsReplacedOnRequestOnly) {
  ASSERT_EQ(gflow(train("run", {"--iterations", "1"})).code, 0);
  std::vector<std::string> again = train("run", {"--iterations", "2"});
  expect_refused(again, {run("run"), "a finished run of " + scene_->path(), "--overwrite"});
  EXPECT_TRUE(fs::exists(run("run") + "/results.json"));
  again.push_back("--overwrite");
  EXPECT_EQ(gflow(again).code, 0);
  EXPECT_TRUE(fs::exists(checkpoint(2)));
}

// Its planes are inside a box around the initial Gaussians.
TEST_F(Resume, AHexplaneTrainingNeedsItsCheckpointOnly) {
  ASSERT_EQ(gflow(train("run", {"--iterations", "40", "--set", "motion.model=hexplane"})).code, 0);
  const std::vector<std::string> whole = left_in("run");
  for (const fs::path file : {"input.ply", "input.motion.npz", "point_cloud", "training.json",
                              "checkpoints/iteration_40.npz"})
    EXPECT_GT(fs::remove_all(run("run") / file), 0u) << file;
  const Outcome evaluated = gflow({"eval", run("run"), "--quiet"});
  EXPECT_EQ(evaluated.code, 0) << evaluated.err;
  const Outcome outcome = gflow(resume());
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_TRUE(left_in("run") == whole);
}

// Only checkpoints exceed the disk: training continues, and only the last one is an error.
TEST_F(Resume, AFullDiskStopsNoTraining) {
  const std::string cache = "export GFLOW_CACHE_DIR='" + run("cache") + "'";
  const std::vector<std::string> fixed{"--set", "density.enabled=false", "--set",
                                       "train.checkpoint_every=100", "--overwrite"};
  ASSERT_EQ(gflow(train("run", fixed), cache).code, 0);
  // Shells count blocks of 512 or of 1024 bytes.
  const uintmax_t blocks = std::max(fs::file_size(run("run") + "/input.ply"),
                                    fs::file_size(run("run") + "/config.toml")) /
                               512 +
                           1;
  ASSERT_LT(1024 * blocks, fs::file_size(checkpoint(200)));
  const Outcome outcome =
      gflow(train("run", fixed), cache + "; ulimit -f " + std::to_string(blocks));
  EXPECT_EQ(outcome.code, 1);
  EXPECT_NE(outcome.err.find("warning: checkpoint of step 200 not saved"), std::string::npos)
      << outcome.err;
  EXPECT_NE(outcome.err.find("iteration_240.npz: "), std::string::npos) << outcome.err;
  EXPECT_EQ(latest_model("run"), RunFolder(run("run")).model_path(240));
}

}  // namespace
}  // namespace gflow
