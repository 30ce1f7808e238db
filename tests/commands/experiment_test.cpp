// SPDX-License-Identifier: Apache-2.0
// `gflow experiment`: each run of a file is trained once, whatever interrupts it, and the tables
// contain the results.
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "tests/support/command.hpp"
#include "tests/support/small_scene.hpp"

namespace gflow {
namespace {

using Json = nlohmann::json;

// Number of steps, and an initial model that does not exist.
const char* const no_first_file = "5\ninit.from = \"file\"\ninit.file = \"/no/such.ply\"";

class Experiment : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    Queue queue = test_queue();
    scene_ = new SmallScene(queue);
  }
  static void TearDownTestSuite() { delete scene_; }

  // An experiment file with two choices and two seeds on the small scene, called "small".
  std::string file(const std::string& more = "", const std::string& steps = "4") const {
    return folder_.write("a.toml", fmt::format(R"(title = "A test, of choices"
scenes = [{{ path = "{}", name = "small" }}]
seeds = [0, 3]
{}
[settings]
train.iterations = {}
train.checkpoint_every = 1
flow.weight = 0.1
[[axis]]
name = "flow"
choices = [{{ name = "off", flow.enabled = false }}, {{ name = "on" }}]
)",
                                               scene_->path(), more, steps));
  }
  std::string out(const std::string& name = "") const { return folder_.file("out") + name; }
  Outcome experiment(const std::string& file, std::vector<std::string> more = {}) const {
    more.insert(more.begin(), {"experiment", file, "-o", out(), "--quiet"});
    return gflow(more);
  }
  std::string run(const std::string& id) const { return out("/runs/" + id); }
  // Number of flow files that both runs share.
  int flow_files_shared(const std::string& id, const std::string& other) const {
    int shared = 0;
    for (const auto& entry : fs::recursive_directory_iterator(run(id) + "/flow")) {
      const fs::path its = run(other) / fs::relative(entry.path(), run(id));
      shared += entry.is_regular_file() && fs::exists(its) && fs::equivalent(entry.path(), its);
    }
    return shared;
  }
  static Json read(const std::string& path) { return Json::parse(contents(path)); }

  TemporaryFolder folder_;
  inline static SmallScene* scene_ = nullptr;
};

TEST_F(Experiment, TrainsWhatTheFileNamesAndTabulatesIt) {
  const Outcome outcome = experiment(file("baseline = \"off\"\n"));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");
  const Json table = read(out("/table.json"));
  ASSERT_EQ(table["rows"].size(), 2u);
  for (const char* choice : {"off", "on"}) {
    const Json& row = table["rows"][choice == std::string("on")];
    EXPECT_EQ(row["scene"], "small");
    EXPECT_EQ(row["flow"], choice);
    double sum = 0, squares = 0;
    for (const char* seed : {"0", "3"}) {
      const std::string path = run(fmt::format("small-{}-seed{}", choice, seed));
      const double psnr = read(path + "/results.json")["test"]["psnr"];
      sum += psnr;
      squares += psnr * psnr;
      EXPECT_NE(contents(path + "/config.toml").find(std::string("seed = ") + seed),
                std::string::npos);
    }
    EXPECT_NEAR(row["metrics"]["psnr"]["mean"].get<double>(), sum / 2, 1e-12);
    EXPECT_NEAR(row["metrics"]["psnr"]["std"].get<double>(),
                std::sqrt(std::max(0.0, squares - sum * sum / 2)), 1e-6);
    EXPECT_EQ(row["metrics"]["psnr"]["values"].size(), 2u);
  }
  const std::string markdown = contents(out("/table.md"));
  EXPECT_NE(markdown.find("# A test, of choices"), std::string::npos);
  EXPECT_NE(markdown.find("4 of 4 runs"), std::string::npos);
  EXPECT_NE(markdown.find("| small | off | "), std::string::npos);
  EXPECT_NE(markdown.find(" (+"), std::string::npos) << markdown;  // compared with the baseline
  EXPECT_EQ(outcome.out.rfind(markdown, 0), 0u);
  const std::string report = contents(out("/report.html"));
  EXPECT_NE(report.find("4 of 4 runs"), std::string::npos);
  EXPECT_NE(report.find("alt=\"Contact sheet small\""), std::string::npos);
  const std::string runs = contents(out("/runs.csv"));
  EXPECT_EQ(std::count(runs.begin(), runs.end(), '\n'), 5);
  EXPECT_EQ(runs.rfind("run,scene,flow,seed,psnr,", 0), 0u);
  EXPECT_NE(contents(out("/costs.md")).find("minutes"), std::string::npos);
  EXPECT_NE(contents(out("/plots/psnr.tsv")).find("small\t"), std::string::npos);
  EXPECT_NE(contents(out("/plots/curve_small_steps.tsv")).find("off"), std::string::npos);
  const Image sheet = read_image(out("/pictures/small.png"));
  const Image one = read_image(run("small-on-seed0") + "/compare.png");
  // White to the right of the caption: no word is cut off.
  for (int y = 0; y < 24; ++y)
    EXPECT_EQ(sheet.pixels[3 * (size_t(y) * size_t(sheet.width) + size_t(sheet.width) - 1)], 255);
  EXPECT_GE(sheet.width, one.width);
  EXPECT_GT(sheet.height, 2 * one.height);
}

// The scene has five steps and one test camera.
TEST_F(Experiment, MetricsOfSomeStepsOfTheVideo) {
  ASSERT_EQ(experiment(file("metrics = [\"psnr@1-2\", \"psnr\", \"psnr@3-9\"]")).code, 0);
  const Json row = read(out("/table.json"))["rows"][1];
  double mean = 0;
  for (const char* seed : {"0", "3"}) {
    const Json views = read(run(std::string("small-on-seed") + seed) + "/per_view.json");
    for (const char* view : {"cam00_0001", "cam00_0002"})
      mean += views[view]["psnr"].get<double>() / 4;
  }
  EXPECT_NEAR(row["metrics"]["psnr@1-2"]["mean"], mean, 1e-9);
  EXPECT_NE(row["metrics"]["psnr@1-2"]["mean"], row["metrics"]["psnr"]["mean"]);
  EXPECT_NE(contents(out("/table.md")).find("PSNR [dB], steps 1 to 2"), std::string::npos);
  EXPECT_TRUE(row["metrics"]["psnr@3-9"]["mean"].is_null());  // there is no step 9
}

TEST_F(Experiment, ImagesOfAViewAtSomeSteps) {
  for (const char* film : {"cam99@0-1", "cam00@5-9"}) {  // rejected before anything is trained
    const Outcome refused =
        experiment(file(fmt::format("films = [\"cam00@0-1\", \"{}\"]\n", film)));
    EXPECT_EQ(refused.code, 1);
    EXPECT_NE(refused.err.find(fmt::format(
                  "a.toml: no scene has test views for film {}: small has cam00@0-4", film)),
              std::string::npos)
        << refused.err;
    EXPECT_FALSE(fs::exists(out()));
  }
  const Outcome outcome = experiment(file("films = [\"cam00@1-3\"]\n"));
  ASSERT_EQ(outcome.code, 0);
  const Image sheet = read_image(out("/pictures/small_cam00_1-3.png"));
  const Image one = read_image(run("small-on-seed0") + "/test/cam00_0002.png");
  const int compared = read_image(run("small-on-seed0") + "/compare.png").height;
  const int words = (read_image(out("/pictures/small.png")).height - 2 * compared) / 3;
  EXPECT_GE(sheet.width, 3 * one.width);                // steps 1, 2, 3, and space for the captions
  EXPECT_EQ(sheet.height, 3 * one.height + 4 * words);  // truth and two rows
  // The middle image of the last row.
  for (const int x : {0, one.width / 2, one.width - 1})
    EXPECT_EQ(sheet.pixels[3 * (size_t(sheet.height - 1) * sheet.width + one.width + x)],
              one.pixels[3 * (size_t(one.height - 1) * one.width + x)]);
}

TEST_F(Experiment, DoesNothingTwiceAndTheSameTableAgain) {
  const std::string toml = file();
  ASSERT_EQ(experiment(toml).code, 0);
  const std::string table = contents(out("/table.csv"));
  const auto trained = fs::last_write_time(run("small-on-seed0") + "/results.json");
  ASSERT_EQ(experiment(toml).code, 0);
  EXPECT_EQ(fs::last_write_time(run("small-on-seed0") + "/results.json"), trained);
  EXPECT_EQ(contents(out("/table.csv")), table);
  // Starts over, two at a time; one run was lost, one stopped before its results.
  EXPECT_GT(flow_files_shared("small-on-seed3", "small-on-seed0"), 0);
  fs::remove_all(run("small-off-seed0"));
  std::ofstream(run("small-on-seed3") + "/results.json") << "{ damaged";
  EXPECT_NE(experiment(toml, {"--dry-run"}).out.find("4 runs, 2 of them finished"),
            std::string::npos);
  ASSERT_EQ(experiment(toml, {"--jobs", "2"}).code, 0);
  EXPECT_EQ(contents(out("/table.csv")), table);
}

// Characters with a meaning in tables and plots, a baseline for each row of a group, and rows with
// fewer steps than a film shows.
TEST_F(Experiment, OddNamesBaselinesOfAGroupAndShorterRows) {
  const Outcome outcome = experiment(folder_.write(
      "odd.toml", fmt::format("scenes = [{{ path = '{}', name = \"o'clock\" }}]\n"
                              "metrics = ['psnr']\nfilms = ['cam00@1-4']\n"
                              "baseline = ['*', \"it's | all\"]\n"
                              "[settings]\ntrain.iterations = 2\nflow.enabled = false\n"
                              "[[axis]]\nname = 'ssim | weight'\nsetting = 'loss.ssim'\n"
                              "values = [0, 0.2]\n[[axis]]\nname = 'steps used'\n"
                              "choices = [{{ name = \"it's | all\" }}, "
                              "{{ name = 'three', scene.max_steps = 3 }}]\n",
                              scene_->path())));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(outcome.err, "");  // gnuplot accepted the names
  std::string markdown = contents(out("/table.md"));
  markdown.erase(0, markdown.find("| scene"));
  EXPECT_NE(markdown.find("| scene | ssim \\| weight | steps used | PSNR [dB] |"),
            std::string::npos)
      << markdown;
  EXPECT_NE(markdown.find("| o'clock | 0.2 | it's \\| all | "), std::string::npos) << markdown;
  const Json rows = read(out("/table.json"))["rows"];
  const auto psnr = [&](size_t row) { return rows[row]["metrics"]["psnr"]["mean"].get<double>(); };
  for (const size_t base : {0, 2})  // each row against the one above, of the same weight
    EXPECT_NE(markdown.find(fmt::format("({:+.2f})", psnr(base + 1) - psnr(base))),
              std::string::npos)
        << markdown;
  EXPECT_EQ(std::count(markdown.begin(), markdown.end(), '('), 2) << markdown;

  const Image film = read_image(out("/pictures/o_clock_cam00_1-4.png"));
  const Image one = read_image(run("o_clock-0-three-seed0") + "/test/cam00_0002.png");
  const auto last_row = [](const Image& image, int x) {
    return image.pixels[3 * (size_t(image.height - 1) * size_t(image.width) + size_t(x))];
  };
  for (const int x : {0, one.width - 1})  // the last training has steps 1 and 2, then white
    EXPECT_EQ(last_row(film, one.width + x), last_row(one, x));
  for (int x = 2 * one.width; x < film.width; ++x) EXPECT_EQ(last_row(film, x), 255) << x;
}

// The cell in row `row` (from 0) and the column called `name`.
std::string cell_of(const std::string& markdown, const std::string& name, size_t row) {
  const auto cells = [](const std::string& line) {
    std::vector<std::string> words;
    for (size_t at = line.find("| "); at != std::string::npos && at + 2 < line.size();) {
      const size_t end = line.find(" |", at);
      words.push_back(line.substr(at + 2, end - at - 2));
      at = end + 1;
    }
    return words;
  };
  std::istringstream lines(markdown.substr(markdown.find("| scene ")));
  std::string line;
  std::getline(lines, line);
  const auto head = cells(line);
  const auto column = std::find(head.begin(), head.end(), name);
  for (size_t i = 0; i < row + 2; ++i) std::getline(lines, line);
  return column == head.end() ? "no column" : cells(line).at(size_t(column - head.begin()));
}

TEST_F(Experiment, ANetworkThatIsNotGivenIsNotPassedOver) {
  const std::string plain = file("", "4");
  ASSERT_EQ(experiment(plain).code, 0);
  const std::string markdown = contents(out("/table.md")), csv = contents(out("/table.csv"));
  for (const char* name : {"LPIPS", "CLIP"})
    for (const size_t row : {0, 1})
      EXPECT_EQ(cell_of(markdown, name, row), "no model given") << markdown;
  EXPECT_NE(cell_of(markdown, "flicker [grey levels]", 1), "no column") << markdown;
  EXPECT_NE(cell_of(markdown, "Fl-all [%]", 1), "no column") << markdown;
  EXPECT_EQ(cell_of(markdown, "depth error [%]", 1), "no column");  // the scene has no true depth
  EXPECT_NE(csv.find(",no model given,"), std::string::npos) << csv;
  EXPECT_NE(contents(out("/runs.csv")).find(",no model given,"), std::string::npos);
  EXPECT_FALSE(fs::exists(out("/plots/lpips.tsv")));

  // A network given later evaluates the finished runs.
  const std::string log = contents(run("small-on-seed0") + "/metrics.jsonl");
  const std::string with =
      file("", "4\nmetrics.lpips = \"" GFLOW_SOURCE_DIR "/tests/data/networks/lpips.onnx\"");
  EXPECT_NE(experiment(with, {"--dry-run"}).out.find("4 runs, 0 of them finished"),
            std::string::npos);
  const Outcome outcome = experiment(with);
  if (contents(run("small-on-seed0") + ".log").find("libopencv-dnn-dev") != std::string::npos)
    GTEST_SKIP() << "built without OpenCV's dnn module";
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_EQ(contents(run("small-on-seed0") + "/metrics.jsonl"), log);
  const Json lpips = read(out("/table.json"))["rows"][1]["metrics"]["lpips"];
  EXPECT_EQ(lpips["values"].size(), 2u);
  EXPECT_GT(lpips["mean"], 0);
  EXPECT_EQ(cell_of(contents(out("/table.md")), "CLIP", 0), "no model given");
  EXPECT_NE(experiment(with, {"--dry-run"}).out.find("4 runs, 4 of them finished"),
            std::string::npos);
  // Without the setting, the existing metrics are kept.
  EXPECT_NE(experiment(plain, {"--dry-run"}).out.find("4 runs, 4 of them finished"),
            std::string::npos);
}

TEST_F(Experiment, ResultsOfAnEarlierGflowAreStillRead) {
  const std::string toml = file();
  ASSERT_EQ(experiment(toml).code, 0);
  for (const char* id : {"off-seed0", "off-seed3", "on-seed0", "on-seed3"}) {
    const std::string path = run(std::string("small-") + id) + "/results.json";
    Json results = read(path);
    for (const char* key : {"ssim_dynamic", "fl_all", "depth_error", "flicker", "lpips", "clip",
                            "lpips_model", "clip_model"})
      results["test"].erase(key);
    std::ofstream(path) << results.dump();
  }
  const Outcome outcome = experiment(toml);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::string markdown = contents(out("/table.md"));
  EXPECT_NE(markdown.find("4 of 4 runs"), std::string::npos);
  for (const char* name : {"LPIPS", "flicker [grey levels]"})
    EXPECT_EQ(cell_of(markdown, name, 0), "no column") << markdown;
  ASSERT_EQ(experiment(file("metrics = [\"psnr\", \"flicker\", \"lpips\"]")).code, 0);
  for (const char* name : {"LPIPS", "flicker [grey levels]"})
    EXPECT_EQ(cell_of(contents(out("/table.md")), name, 0), "-");
}

TEST_F(Experiment, ASignalStopsItAndTheSameCommandGoesOn) {
  const std::string toml = file("", "3000");
  Command command({"experiment", toml, "-o", out(), "--quiet"});
  const auto has_begun = [&] { return fs::exists(run("small-off-seed0") + "/metrics.jsonl"); };
  for (int i = 0; i < 6000 && !has_begun(); ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  command.send_to_group(SIGINT);  // as Ctrl-C does
  const Outcome stopped = command.wait();
  EXPECT_EQ(stopped.code, 130);
  EXPECT_NE(
      stopped.err.find("stopped with 0 of 4 runs finished; run the same command again to continue"),
      std::string::npos)
      << stopped.err;
  const std::string plan = experiment(toml, {"--dry-run"}).out;
  EXPECT_NE(plan.find("stopped after "), std::string::npos) << plan;
  EXPECT_NE(plan.find("4 runs, 0 of them finished"), std::string::npos) << plan;
  // The trainings received one signal and saved.
  const std::string log = contents(out("/runs/small-off-seed0.log"));
  EXPECT_NE(log.find("interrupted after "), std::string::npos) << log;
}

// However it ends, because nothing would wait for its trainings.
TEST_F(Experiment, ItsTrainingsEndWithIt) {
  const std::string toml = file("", "1000000");
  Command command({"experiment", toml, "-o", out(), "--quiet"});
  ASSERT_TRUE(wait_until([&] { return fs::exists(run("small-off-seed0") + "/metrics.jsonl"); }));
  command.send(SIGKILL);
  command.wait();
  const std::string log = out("/runs/small-off-seed0.log");
  EXPECT_TRUE(wait_until([&] {
    return contents(log).find("interrupted after ") != std::string::npos;
  })) << contents(log);
}

// Flow over two steps differs from flow over one, though the images have the same names.
TEST_F(Experiment, FlowIsSharedBetweenRunsOfTheSameImagesOnly) {
  const std::string toml = folder_.write(
      "strides.toml", fmt::format("scenes = [{{ path = '{}', name = 'small' }}]\n"
                                  "[settings]\ntrain.iterations = 2\n"
                                  "[[axis]]\nsetting = 'scene.stride'\nname = 'stride'\n"
                                  "values = [1, 2]\n"
                                  "[[axis]]\nsetting = 'flow.weight'\nvalues = [0.1, 0.2]\n",
                                  scene_->path()));
  ASSERT_EQ(experiment(toml).code, 0);
  EXPECT_GT(flow_files_shared("small-1-0.2-seed0", "small-1-0.1-seed0"), 0);
  EXPECT_EQ(flow_files_shared("small-2-0.1-seed0", "small-1-0.1-seed0"), 0);
  EXPECT_GT(flow_files_shared("small-2-0.2-seed0", "small-2-0.1-seed0"), 0);
}

// A killed gflow leaves its training behind: the next one waits for it and does not count it as
// failed.
TEST_F(Experiment, WhatAnotherProcessTrainsIsWaitedFor) {
  const std::string toml = file("", "40");  // a second each
  {
    Command command({"experiment", toml, "-o", out(), "--quiet"});
    for (int i = 0; i < 6000 && !fs::exists(run("small-off-seed0") + "/metrics.jsonl"); ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    command.send(SIGKILL);
    command.wait();
  }
  const Outcome outcome = experiment(toml);
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_NE(contents(out("/table.md")).find("4 of 4 runs"), std::string::npos);
}

TEST_F(Experiment, ADeviceThatIsNotThereIsToldBeforeAnythingIsTrained) {
  const auto expect_no_device = [&](const std::vector<std::string>& more, const char* driver,
                                    const char* why) {
    std::vector<std::string> arguments{"experiment", file(), "-o", out(), "--quiet"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Outcome outcome = gflow(arguments, driver);
    EXPECT_EQ(outcome.code, 2);
    EXPECT_EQ(outcome.out, "");
    EXPECT_NE(outcome.err.find(why), std::string::npos) << outcome.err;
    EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
    EXPECT_FALSE(fs::exists(out()));
  };
  expect_no_device({"--devices", "no such device"}, "", "matches 'no such device'");
  expect_no_device({"--device", "999"}, "", "no OpenCL device 999");
  expect_no_device({}, "export OCL_ICD_VENDORS=/no/such/folder/", "no OpenCL device found");
  expect_no_device({}, "export GFLOW_DEVICE=999", "no OpenCL device 999");
}

// Parallel trainings have fewer cores each, which must not change any bit of any motion model. Uses
// enough Gaussians for sums over them to be split.
TEST_F(Experiment, TheNumberOfCoresChangesNoBit) {
  for (const char* motion : {"spacetime", "native4d", "keyframes", "bases", "hexplane", "nodes"}) {
    const auto model = [&](const std::string& cores) {
      const std::string path = out(motion + cores);
      EXPECT_EQ(gflow({"train", scene_->path(), "-o", path, "--iterations", "8", "--quiet", "--set",
                       std::string("motion.model=") + motion, "--set", "init.from=random", "--set",
                       "init.count=2000"},
                      "export POCL_MAX_PTHREAD_COUNT=" + cores)
                    .code,
                0);
      std::map<std::string, std::string> files;
      for (const auto& entry : fs::directory_iterator(path + "/point_cloud/iteration_8"))
        files[entry.path().filename()] = contents(entry.path().string());
      EXPECT_FALSE(files.empty());
      return files;
    };
    EXPECT_TRUE(model("1") == model("2")) << motion;
  }
}

TEST_F(Experiment, OtherSettingsAreNotMixedIn) {
  ASSERT_EQ(experiment(file()).code, 0);
  const std::string changed = file("", "5");
  const Outcome refused = experiment(changed);
  EXPECT_EQ(refused.code, 1);
  EXPECT_NE(refused.err.find("small-off-seed0 was trained: train.iterations was 4, now it is 5; "
                             "retrain such runs with --redo"),
            std::string::npos)
      << refused.err;
  EXPECT_EQ(read(run("small-off-seed0") + "/results.json")["iterations"], 4);
  // A training that is repeated and fails leaves no results of the previous run.
  EXPECT_EQ(experiment(file("", no_first_file), {"--redo"}).code, 1);
  file("", "5");  // unchanged
  EXPECT_NE(experiment(changed, {"--dry-run"}).out.find("4 runs, 0 of them finished"),
            std::string::npos);
  const Outcome redone = experiment(changed, {"--redo"});
  ASSERT_EQ(redone.code, 0) << redone.err;
  EXPECT_EQ(read(run("small-on-seed3") + "/results.json")["iterations"], 5);
}

TEST_F(Experiment, TablesThatNoExperimentHasWrittenAreLeftAlone) {
  const std::string toml = file("", "1");
  for (const char* name : {"table.csv", "runs.csv", "pictures/small.png"}) {
    const std::string mine = folder_.write(std::string("out/") + name, "my own");
    folder_.write("out/runs/notes.txt", "");
    for (const std::vector<std::string>& more : {std::vector<std::string>{}, {"--dry-run"}}) {
      const Outcome outcome = experiment(toml, more);
      EXPECT_EQ(outcome.code, 1) << name;
      EXPECT_NE(outcome.err.find("which is not from an experiment"), std::string::npos)
          << outcome.err;
    }
    EXPECT_EQ(contents(mine), "my own");
    EXPECT_EQ(folder_.count(), 3u) << name;  // with its notes and the plan
    fs::remove_all(out());
  }
  folder_.write("out/notes.txt", "");
  EXPECT_EQ(experiment(toml, {"--dry-run"}).code, 0);
}

TEST_F(Experiment, TheFileIsNotItsFolder) {
  const std::string toml = file();
  for (const std::string name : {"plan", ".toml"}) {
    fs::copy_file(toml, folder_.file(name));
    for (const char* option : {"--quiet", "--dry-run"})
      expect_refused(
          {"experiment", name, option},
          {name + ": the default output folder", "the file itself; give a folder with -o"},
          "cd '" + folder_.path() + "'");
  }
}

TEST_F(Experiment, ARunThatFailsLeavesTheOthers) {
  // Every run fails, and each says why in its log.
  const Outcome none = experiment(file("", no_first_file));
  EXPECT_EQ(none.code, 1);
  EXPECT_NE(none.err.find("4 of 4 runs failed"), std::string::npos) << none.err;
  EXPECT_NE(none.err.find("no/such.ply"), std::string::npos) << none.err;
  // One run cannot be created because a file is in its place.
  fs::remove_all(out());
  fs::create_directories(out("/runs"));
  std::ofstream(run("small-off-seed0")) << "in the way";
  const Outcome one = experiment(file());
  EXPECT_EQ(one.code, 1);
  EXPECT_NE(one.err.find("1 of 4 runs failed"), std::string::npos) << one.err;
  EXPECT_NE(contents(out("/table.md")).find("3 of 4 runs"), std::string::npos);
}

// The small scene stands in for their scenes; its views have other names than in their films.
TEST_F(Experiment, TheShippedFilesAreRead) {
  for (const char* scene : {"n3v-baton", "n3v-sphere", "c4d-hammer", "c4d-fox", "dnerf-knight",
                            "consistent4d_trex", "panoptic_basketball_30"})
    fs::create_directory_symlink(scene_->path(), folder_.file(scene));
  fs::create_directory(folder_.file("dnerf_400"));
  for (const char* scene : {"hook", "jumpingjacks", "lego", "standup", "trex"})
    fs::create_directory_symlink(scene_->path(), folder_.file("dnerf_400/") + scene);
  int files = 0;
  for (const auto& entry : fs::directory_iterator(GFLOW_SOURCE_DIR "/apps/experiments")) {
    if (entry.path().extension() != ".toml") continue;
    ++files;
    const Outcome outcome =
        experiment(entry.path().string(), {"--dry-run", "--scenes", folder_.path()});
    if (contents(entry.path().string()).find("\nfilms = ") != std::string::npos)
      EXPECT_NE(outcome.err.find("no scene has test views for film"), std::string::npos)
          << outcome.err;
    else
      EXPECT_EQ(outcome.code, 0) << entry.path() << outcome.err;
  }
  EXPECT_GE(files, 10);
}

TEST_F(Experiment, FilesThatMakeNoSenseAreRefusedByLine) {
  const auto expect = [&](const std::string& text, std::initializer_list<std::string> words) {
    const Outcome outcome = experiment(folder_.write("a.toml", text));
    EXPECT_EQ(outcome.code, 1);
    for (const std::string& word : words)
      EXPECT_NE(outcome.err.find(word), std::string::npos) << word << "\n" << outcome.err;
    EXPECT_FALSE(fs::exists(out()));
  };
  const std::string scenes = fmt::format("scenes = [\"{}\"]\n", scene_->path());
  expect("", {"a.toml", "the list 'scenes' is missing"});
  expect("scenes = [", {"a.toml, line 1"});
  expect("scenes = [\"nowhere\"]", {"a.toml, line 1", "scene 'nowhere' not found", "--scenes"});
  expect(scenes + "seed = [1]", {"line 2", "'seed'", "seeds"});
  expect(scenes + "seeds = [-1]", {"line 2", "seeds must be whole numbers"});
  expect(scenes + "metrics = [\"psnr\", \"psnr\"]", {"'psnr' is listed twice"});
  expect(scenes + "baseline = \"off\"", {"line 2", "there is no axis"});
  expect(scenes + "baseline = \"*\"\n[[axis]]\nname = \"a\"\nchoices = [{ name = \"b\" }]",
         {"line 2", "'baseline' must have one choice of each axis"});
  expect(scenes + "seeds = [99999999999]", {"line 2", "0 to 2000000000"});
  expect(scenes + "[settings]\nquality = \"fast\"", {"line 3", "draft or standard or best"});
  expect(scenes + "[settings]\nquality = 3", {"line 3", "draft or standard or best", "'3'"});
  expect(scenes + "[settings]\ntrain.seed = 7", {"'train.seed'", "the list 'seeds'"});
  expect(scenes + "[settings]\nscene.path = \"/b\"", {"'scene.path'", "the list 'scenes'"});
  expect(scenes + "[settings]\nmetrics.lpips = \"/no/such.onnx\"", {"no network '/no/such.onnx'"});
  expect(scenes + "films = [\"cam00\"]", {"line 2", "VIEW@FIRST-LAST"});
  for (const char* name : {"metrics", "psnr"})
    expect(scenes + "[[axis]]\nname = \"" + name + "\"\nchoices = [{ name = \"a\" }]",
           {"two columns would be named '" + std::string(name)});
  expect(scenes + "metrics = [\"pnsr\"]", {"line 2", "unknown metric 'pnsr'", "psnr_dynamic"});
  expect(scenes + "metrics = [\"psnr@3-1\"]", {"line 2", "psnr@3-1", "NAME@FIRST-LAST"});
  expect(scenes + "metrics = [\"psnr@2\"]", {"line 2", "NAME@FIRST-LAST"});
  expect(scenes + "metrics = [\"minutes@1-2\"]",
         {"line 2", "'minutes' has no values per time step"});
  expect(scenes + "[settings]\ntrain.iteration = 3", {"line 3", "train.iteration", "iterations"});
  expect(scenes + "[settings]\ntrain.iterations = 0",
         {"a.toml, line 3: train.iterations = 0 is not allowed", "at least 1"});
  expect(scenes + "[[variant]]\nname = \"a\"\nflow.weight = nan", {"a.toml, line 4: flow.weight"});
  expect(scenes + "[[axis]]\nname = \"x\"", {"line 2", "choices"});
  std::string axes;  // 2^64 runs
  for (int i = 0; i < 64; ++i)
    axes += fmt::format(
        "[[axis]]\nname = \"x{}\"\nchoices = [{{ name = \"a\" }}, {{ name = \"b\" }}]\n", i);
  expect(scenes + axes, {"64 axes", "1.845e+19 runs", "at most 10000"});
  expect(scenes + "[[axis]]\nsetting = \"flow.top_k\"", {"line 2", "no 'values'"});
  expect(scenes + "[[variant]]\nflow.weight = 0.1", {"line 2", "needs a 'name'"});
  expect(scenes + "[[variant]]\nname = \"a\"\n[[variant]]\nname = \"a\"", {"two runs", "a-seed0"});
  expect(scenes + "[[variant]]\nname = \"" + std::string(300, 'a') + "\"",
         {"aaa...", "at most 200", "shorten the names"});
  expect(scenes + "baseline = \"b\"\n[[variant]]\nname = \"a\"", {"line 2", "'baseline'"});
  expect(scenes + "[[axis]]\nname = \"scene\"\nchoices = [{ name = \"a\" }]", {"two columns"});
}

}  // namespace
}  // namespace gflow
