// SPDX-License-Identifier: Apache-2.0
// `gflow train` with guidance by a program, from settings to files: trained, interrupted, resumed,
// rejected.
#include "tests/support/command.hpp"
#include "tests/support/python.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

// A scene with images and flow of its held-out camera as known views, and a program that guides
// towards them. The program dies in step 30 unless the file `healthy` exists.
class GuidanceCommand : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    Queue queue = test_queue();
    scene_ = new SmallScene(queue);
    folder_ = new TemporaryFolder;
    const std::string views = path("views");
    fs::create_directories(views + "/flow");
    fs::copy(scene_->path() + "/cam00/images", views + "/cam00");
    fs::copy(scene_->path() + "/flow/cam00", views + "/flow/cam00");
    folder_->write("mortal.py", R"(
import os, sys
from example_target import Target
from gflow_guidance import serve
target = Target(sys.argv[1] + "/views")
def guide(request):
    if request.step == 30 and not os.path.exists(sys.argv[1] + "/healthy"):
        os._exit(5)
    return target.guide(request)
serve(guide)
)");
  }
  static void TearDownTestSuite() {
    delete scene_;
    delete folder_;
  }

  static std::string path(const std::string& name) { return folder_->path() + "/" + name; }
  static std::string write_config(const std::string& command) {
    TrainOptions config = small_config(*scene_, 60);
    config.train.log_every = 10;
    config.guidance.provider = GuidanceProvider::process;
    config.guidance.command = command;
    config.guidance.cameras = GuidanceCameras::test;
    config.guidance.weight = 1;
    config.guidance.flow = 0.05f;
    folder_->write("config.toml", to_toml(config));
    return path("config.toml");
  }
  static std::vector<std::string> train(const std::string& run, const std::string& command) {
    return {"train",    scene_->path(),        "-o",      path(run),
            "--config", write_config(command), "--quiet", "--allow-command"};
  }
  static std::string result(const std::string& run) {
    return contents(path(run) + "/point_cloud/iteration_60/point_cloud.ply") +
           contents(path(run) + "/per_view.json");
  }

  static SmallScene* scene_;
  static TemporaryFolder* folder_;
};
SmallScene* GuidanceCommand::scene_ = nullptr;
TemporaryFolder* GuidanceCommand::folder_ = nullptr;

TEST_F(GuidanceCommand, AProgramThatDiesCostsNothingButTheTime) {
  if (!has_python()) GTEST_SKIP() << "python3 with numpy is not installed";
  const std::string command = python() + path("mortal.py") + " " + folder_->path();
  fs::remove(path("healthy"));
  const Outcome broken = gflow(train("broken", command));
  EXPECT_EQ(broken.code, 1) << broken.err;
  EXPECT_EQ(std::count(broken.err.begin(), broken.err.end(), '\n'), 1) << broken.err;
  for (const std::string& part :
       {std::string("exited with code 5"), std::string("30 steps are saved"),
        "`gflow train -o " + path("broken") + " --resume --allow-command`"})
    EXPECT_NE(broken.err.find(part), std::string::npos) << broken.err;

  folder_->write("healthy", "");
  const Outcome resumed =
      gflow({"train", "-o", path("broken"), "--resume", "--quiet", "--allow-command"});
  EXPECT_EQ(resumed.code, 0) << resumed.err;
  const Outcome whole = gflow(train("whole", command));
  ASSERT_EQ(whole.code, 0) << whole.err;
  EXPECT_TRUE(result("broken") == result("whole"));
  std::ifstream metrics(path("whole") + "/metrics.jsonl");
  std::string line;
  ASSERT_TRUE(std::getline(metrics, line));
  EXPECT_NE(line.find("\"guidance\":0."), std::string::npos) << line;
}

// A command from a file runs only if the user allows it.
TEST_F(GuidanceCommand, AProgramThatAFileNamesIsNotStartedUnasked) {
  const std::string ran = path("ran"), command = "touch " + ran + "; exit 3";
  std::vector<std::string> of_config = train("unasked", command);
  of_config.pop_back();
  expect_refused(of_config, {"config.toml starts a program", "touch " + ran, "--allow-command"});
  EXPECT_FALSE(fs::exists(path("unasked")));

  // An untrusted run, with the command in its settings and in a checkpoint alone.
  ASSERT_EQ(
      gflow({"train", scene_->path(), "-o", path("theirs"), "--iterations", "2", "--quiet"}).code,
      0);
  const RunFolder theirs(path("theirs"));
  Checkpoint checkpoint = read_checkpoint(theirs.checkpoints().path(2));
  TrainOptions config = theirs.read_config();
  config.guidance.provider = GuidanceProvider::process;
  config.guidance.command = command;
  config.train.iterations = 4;
  checkpoint.facts.config = to_toml(config);
  theirs.checkpoints().write(checkpoint);
  theirs.write_config(config);
  const std::vector<std::string> resume{"train", "-o", path("theirs"), "--resume", "--quiet"};
  expect_refused(resume, {path("theirs") + " starts a program", "--allow-command"});
  fs::remove(path("theirs") + "/config.toml");
  const Outcome from_checkpoint = gflow(resume);
  EXPECT_EQ(from_checkpoint.code, 1);
  EXPECT_NE(from_checkpoint.err.find("starts a program"), std::string::npos);

  folder_->write("plan.toml", "scenes = [\"" + scene_->path() +
                                  "\"]\n[settings]\nguidance.provider = \"process\"\n"
                                  "guidance.command = \"" +
                                  command + "\"\n");
  expect_refused({"experiment", path("plan.toml"), "-o", path("plan")},
                 {"plan.toml: training", "starts a program", "--allow-command"});
  EXPECT_FALSE(fs::exists(path("plan")));
  EXPECT_FALSE(fs::exists(ran));

  // A command named or allowed on the command line runs.
  std::vector<std::string> named = of_config;
  named.insert(named.end(), {"--set", "guidance.command=" + command});
  expect_refused(named, {"exited with code 3"});
  EXPECT_TRUE(fs::remove(ran));
  of_config.push_back("--allow-command");
  expect_refused(of_config, {"exited with code 3"});
  EXPECT_TRUE(fs::remove(ran));
}

// A training that fails before its first step replaces nothing.
TEST_F(GuidanceCommand, AFormerTrainingStaysUntilTheFirstStepOfAnother) {
  ASSERT_EQ(
      gflow({"train", scene_->path(), "-o", path("former"), "--iterations", "2", "--quiet"}).code,
      0);
  const auto left = [] {
    std::string all;
    for (const char* name : {"config.toml", "results.json", "input.ply", "training.json",
                             "metrics.jsonl", "point_cloud/iteration_2/point_cloud.ply"})
      all += contents(path("former") + "/" + name);
    return all;
  };
  const std::string before = left();
  std::vector<std::string> another = train("former", "echo '{\"version\": 1}'");
  another.push_back("--overwrite");
  const Outcome outcome = gflow(another);
  EXPECT_EQ(outcome.code, 1);
  EXPECT_NE(outcome.err.find("exited with code 0; the previous run is unchanged"),
            std::string::npos)
      << outcome.err;
  EXPECT_TRUE(left() == before);
  EXPECT_TRUE(fs::exists(path("former") + "/checkpoints/iteration_2.npz"));
}

TEST_F(GuidanceCommand, AnInterruptionDoesNotWaitForTheAnswer) {
  if (!has_python()) GTEST_SKIP() << "python3 with numpy is not installed";
  folder_->write("slow.py", R"(
import os, sys, time
from example_target import Target
from gflow_guidance import serve
target = Target(sys.argv[1] + "/views")
def guide(request):
    if request.step == 12 and not os.path.exists(sys.argv[1] + "/quick"):
        open(sys.argv[1] + "/asked", "w").close()
        time.sleep(200)
    return target.guide(request)
serve(guide)
)");
  const std::string command = python() + path("slow.py") + " " + folder_->path();
  const Command training(train("slow", command));
  for (int i = 0; i < 3000 && !fs::exists(path("asked")); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  ASSERT_TRUE(fs::exists(path("asked")));
  training.send(SIGINT);
  const Outcome outcome = training.wait();
  EXPECT_EQ(outcome.code, 130) << outcome.err;
  // Waiting for the answer would have taken one more step.
  EXPECT_NE(outcome.err.find("interrupted after 12 of 60 steps"), std::string::npos) << outcome.err;

  folder_->write("quick", "");
  const Outcome resumed =
      gflow({"train", "-o", path("slow"), "--resume", "--quiet", "--allow-command"});
  EXPECT_EQ(resumed.code, 0) << resumed.err;
  const Outcome whole = gflow(train("quickly", command));
  ASSERT_EQ(whole.code, 0) << whole.err;
  EXPECT_TRUE(result("slow") == result("quickly"));
}

TEST_F(GuidanceCommand, AFinishedRunAsksNobody) {
  if (!has_python()) GTEST_SKIP() << "python3 with numpy is not installed";
  folder_->write("healthy", "");
  const std::string command = python() + path("mortal.py") + " " + folder_->path();
  ASSERT_EQ(gflow(train("finished", command)).code, 0);
  const Outcome again = gflow(
      {"train", "-o", path("finished"), "--resume", "--quiet", "--set", "guidance.command=exit 3"});
  EXPECT_EQ(again.code, 0) << again.err;
}

TEST_F(GuidanceCommand, AProgramThatDoesNotGreetLeavesNoRunBehind) {
  // The shell prints its own message on stderr.
  const Outcome outcome = gflow(train("kept", "no-such-program"));
  EXPECT_EQ(outcome.code, 1);
  EXPECT_NE(outcome.err.find("`no-such-program` exited with code 127"), std::string::npos)
      << outcome.err;
  EXPECT_FALSE(fs::exists(path("kept")));
  expect_refused(train("kept", "exit 3"), {"`exit 3`", "exited with code 3"});
  expect_refused(train("kept", "cat"), {"{\"protocol\":\"gflow-guidance\"", "version"});
}

// The example resizes its images and flow to the size of the views: here half the width.
TEST_F(GuidanceCommand, TheExampleFitsItsImagesToTheViews) {
  if (!has_python()) GTEST_SKIP() << "python3 with numpy is not installed";
  const std::string program = folder_->write("fits.py", R"(
import sys
import numpy as np
from example_target import Target
from gflow_guidance import Camera, View
from image_files import read_flo, read_rgb
views = sys.argv[1] + "/views"
white = np.ones(3)
whole = read_rgb(views + "/cam00/0001.png", white)
(flow, known), (height, width) = read_flo(sys.argv[2]), whole.shape[1:]
def view(w, h):
    camera = Camera("cam00", w, h, np.eye(3), np.eye(4))
    return View(camera, 0, 0, 0, 0.5, np.zeros((3, h, w), np.float32), None)
target = Target(views)
assert np.abs(target.image(view(width, height), 1, white) - whole).max() < 1e-6
half = target.image(view(width // 2, height // 2), 1, white)
assert np.abs(half - whole.reshape(3, height // 2, 2, width // 2, 2).mean((2, 4))).max() < 1e-6
its, there = target.flow(view(width // 2, height // 2), 1)
mean = flow.reshape(2, height // 2, 2, width // 2, 2).mean((2, 4)) / 2
assert there.any() and np.abs(its - mean)[:, there].max() < 1e-5
assert abs(target.image(view(18, 15), 1, white).mean() - whole.mean()) < 1e-3
try:
    target.image(view(width, height // 2), 1, white)
except ValueError as problem:
    assert "the same aspect ratio" in str(problem)
else:
    raise AssertionError("another shape was taken")
)");
  std::string flow = scene_->path() + "/flow/cam00/0001.flo";
  if (!fs::exists(flow)) flow += ".gz";
  const std::string command = python() + program + " " + folder_->path() + " " + flow;
  EXPECT_EQ(std::system((command + " > " + path("fits.err") + " 2>&1").c_str()), 0)
      << contents(path("fits.err"));
}

// Runs the script as a user does; other tests check its results.
TEST_F(GuidanceCommand, TwoStagesGoFromTheImagesToAMovingScene) {
  const std::string script = std::string(GFLOW_SOURCE_DIR) + "/apps/guidance/two_stages";
  const auto run = [&](const std::string& scene) {
    const std::string command = "GFLOW=" + std::string(GFLOW_BINARY) + " " + script + " " + scene +
                                " " + path("stages") +
                                " --iterations 30 --set init.count=200 --set flow.source=files "
                                "--set loss.ssim=0 --quiet > /dev/null 2> " +
                                path("stages.err");
    return std::system(command.c_str());
  };
  EXPECT_NE(run(path("no-scene")), 0);
  EXPECT_NE(contents(path("stages.err")).find("no-scene"), std::string::npos);
  ASSERT_EQ(run(scene_->path()), 0) << contents(path("stages.err"));
  EXPECT_TRUE(fs::exists(path("stages") + "/first.ply"));
  const std::string model = path("stages") + "/dynamic/point_cloud/iteration_30/point_cloud.ply";
  const std::string made = contents(model);
  EXPECT_FALSE(made.empty());
  // Resumes with nothing left to do.
  ASSERT_EQ(run(scene_->path()), 0) << contents(path("stages.err"));
  EXPECT_TRUE(contents(model) == made);
}

TEST_F(GuidanceCommand, WhatIsMissingIsNamed) {
  const auto refused = [&](std::vector<std::string> settings,
                           std::initializer_list<std::string> parts) {
    std::vector<std::string> arguments{"train", scene_->path(), "-o", path("none"), "--quiet"};
    for (const std::string& setting : settings) {
      arguments.push_back("--set");
      arguments.push_back("guidance." + setting);
    }
    expect_refused(arguments, parts);
    EXPECT_FALSE(fs::exists(path("none")));
  };
  refused({"provider=process"}, {"guidance.command is empty"});
  refused({"provider=onnx"}, {"guidance.model is empty"});
  refused({"provider=onnx", "model=no/such.onnx"}, {"no/such.onnx"});
  refused({"provider=analytic"}, {"no .png or .jpg"});  // the scene has its own elsewhere
  refused({"provider=analytic", "images=no/such"}, {"\"no/such\" is not a folder"});
  refused({"provider=analytic", "images=" + path("views/flow")}, {"no .png or .jpg"});
  refused({"provider=analytic", "images=" + path("views"), "beta_start=0.5"},
          {"beta 0.5 to 0.012"});
  refused({"provider=analytic", "images=" + path("views"), "cameras=val"}, {"no val views"});
  refused({"provider=zero123"}, {"guidance.provider", "none, process, onnx, analytic"});
}

}  // namespace
}  // namespace gflow
