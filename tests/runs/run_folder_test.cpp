// SPDX-License-Identifier: Apache-2.0
#include "optim/runs/run_folder.hpp"

#include <sys/wait.h>
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "optim/runs/run_names.hpp"
#include "tests/support/file_size_limit.hpp"
#include "tests/support/memory_of.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

using OrderedJson = nlohmann::ordered_json;

std::vector<std::string> keys_of(const OrderedJson& object) {
  std::vector<std::string> keys;
  for (const auto& [key, value] : object.items()) keys.push_back(key);
  return keys;
}

TEST(RunFolder, IsMadeWithTheFoldersAboveIt) {
  const TemporaryFolder folder;
  RunFolder::create(folder.path() + "/a/b");
  EXPECT_TRUE(std::filesystem::is_directory(folder.path() + "/a/b"));
}

TEST(RunFolder, CannotLieBelowAFile) {
  const TemporaryFolder folder;
  folder.write("file", "");
  expect_error([&] { RunFolder::create(folder.path() + "/file/run"); }, {"file/run"});
}

TEST(RunFolder, IsNotMadeOfALinkToNothing) {
  const TemporaryFolder folder;
  const std::string link = folder.path() + "/link", nowhere = folder.path() + "/nowhere";
  std::filesystem::create_directory_symlink(nowhere, link);
  expect_error([&] { RunFolder::create(link); }, {link + ": it is a link to " + nowhere});
  std::filesystem::create_directory(nowhere);
  RunFolder::create(link);
}

TEST(RunFolder, IsNotMadeOfAFolderThatHoldsSomethingElse) {
  const TemporaryFolder folder;
  folder.write("scene/flow/mine", "true flow");
  expect_error([&] { RunFolder::create(folder.path() + "/scene"); }, {"/scene", "not empty"});
  EXPECT_TRUE(std::filesystem::exists(folder.file("scene/flow/mine")));
  const RunFolder run = RunFolder::create(folder.path() + "/run");
  run.remove_stale_caches("a scene");
  run.write_config({});
  EXPECT_NO_THROW(RunFolder::create(folder.path() + "/run"));  // can be trained from the start
}

// The stamp of the caches was removed.
TEST(RunFolder, WithoutItsStampIsARunStill) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder.path() + "/checkpoints");
  std::filesystem::create_directory(folder.path() + "/point_cloud");
  for (const char* name : {"config.toml", "cameras.json", "video.mp4"}) folder.write(name, "");
  // They may be a user's own files, for --config and --cameras.
  expect_error([&] { RunFolder::create(folder.path()); }, {"not empty"});
  for (const char* trained : {"/checkpoints/iteration_5.npz", "/point_cloud/iteration_5"}) {
    std::filesystem::create_directory(folder.path() + trained);
    EXPECT_NO_THROW(RunFolder::create(folder.path()));
    std::filesystem::remove(folder.path() + trained);
  }
}

TEST(RunFolder, OfATrainingKilledAtItsVeryStartIsUsedAgain) {
  const TemporaryFolder folder;
  folder.write(".lock", "123");
  folder.write(".caches.123-0.part.stamp", "reso");
  std::filesystem::create_directory(folder.path() + "/.next.123-0.part");
  folder.write(".next.123-0.part/config.toml", "");
  const RunFolder run = RunFolder::create(folder.path());
  run.forget_unfinished_files();
  EXPECT_EQ(folder.count(), 1u);
  folder.write(".profile", "of somebody");
  expect_error([&] { RunFolder::create(folder.path()); }, {"not empty"});
}

TEST(RunFolder, KeepsMetricsOfTheStepsBeforeACheckpoint) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  EXPECT_NO_THROW(run.keep_metrics_before(10));  // no log so far
  for (const int iteration : {0, 10}) run.append_metrics(iteration, 1, {});
  const std::string expected = contents(run.path("metrics.jsonl"));
  for (const int iteration : {20, 30}) run.append_metrics(iteration, 1, {});
  std::ofstream(run.path("metrics.jsonl"), std::ios::app) << "{\"iteration\":40,\"sec";
  testing::internal::CaptureStderr();
  run.keep_metrics_before(20);
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  EXPECT_EQ(contents(run.path("metrics.jsonl")), expected);
  for (const std::string& last : {std::string("7\n"), std::string(9, '\0')}) {
    std::ofstream(run.path("metrics.jsonl"), std::ios::app) << last;
    testing::internal::CaptureStderr();
    run.keep_metrics_before(1000);
    EXPECT_NE(testing::internal::GetCapturedStderr().find("line 3 was not written by"),
              std::string::npos);
    EXPECT_EQ(contents(run.path("metrics.jsonl")), expected);
  }
}

// A value of two bytes takes up to 80 bytes of memory: one line once took sixty times its size.
TEST(RunFolder, MetricsThatNobodyWritesEndTheLogInLittleMemory) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  run.append_metrics(0, 1, {});
  const std::string whole = contents(run.path("metrics.jsonl"));
  const size_t mb = size_t{1} << 20;
  std::string ones;
  for (size_t i = 0; i < 4 * mb; ++i) ones += "1,";
  for (const std::string& line :
       {std::string(8 * mb, '['), R"({"iteration":1,"x":[)" + ones + "1]}",
        R"({"iteration":1,"x":")" + std::string(70000, 'x') + "\"}", std::string("{}")}) {
    const std::string log = run.path("metrics.jsonl");
    std::ofstream(log, std::ios::app) << line << '\n' << whole;
    testing::internal::CaptureStderr();
    EXPECT_LT(memory_of([&] { run.keep_metrics_before(10); }),
              2 * double(line.size()) / double(mb) + 64);
    EXPECT_NE(testing::internal::GetCapturedStderr().find(log + ": line 2 was not written by"),
              std::string::npos);
    EXPECT_EQ(contents(log), whole);
  }
}

TEST(RunFolder, TheTableOfMetricsIsMendedFromTheirLines) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  StepReport figures;
  figures.terms = {{"flow_loss", std::nan(""), ""}, {"psnr", 1.0 / 3, ""}};
  for (const int iteration : {0, 10}) run.append_metrics(iteration, 1.25, figures);
  const std::string lines = contents(run.path("metrics.jsonl"));
  const std::string table = contents(run.path("metrics.csv"));
  for (const size_t left : {table.size() - 7, size_t{0}}) {
    std::filesystem::resize_file(run.path("metrics.csv"), left);
    run.keep_metrics_before(20);
    EXPECT_EQ(contents(run.path("metrics.csv")), table);
    EXPECT_EQ(contents(run.path("metrics.jsonl")), lines);
  }
  std::filesystem::remove(run.path("metrics.jsonl"));
  run.keep_metrics_before(20);  // nothing to repair it from
  EXPECT_FALSE(std::filesystem::exists(run.path("metrics.csv")));
  run.append_metrics(20, 1, figures);
  EXPECT_EQ(contents(run.path("metrics.csv")).rfind("iteration,", 0), 0u);
}

TEST(RunFolder, KnowsWhateverIsOfAnEarlierTraining) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  EXPECT_FALSE(run.would_remove(""));
  EXPECT_FALSE(run.would_remove(folder.path() + "/../other.ply"));
  EXPECT_TRUE(run.would_remove(folder.path() + "/./point_cloud/a.ply"));
  EXPECT_TRUE(run.would_remove(folder.path() + "/cameras.json"));
  for (const char* name :
       {"metrics.jsonl", "metrics.csv", "input.ply", "input.motion.npz", "training.json",
        "checkpoints/iteration_1.npz", "point_cloud/iteration_1/point_cloud.ply"})
    folder.write(name, "");
  folder.write("point_cloud/notes.txt", "of a user");
  const std::vector<std::string> all = run.training();
  EXPECT_EQ(all.size(), 7u);
  EXPECT_EQ(all[0], run.path("training.json"));
  for (const std::string& path : all) std::filesystem::remove_all(path);
  EXPECT_TRUE(run.training().empty());
  EXPECT_TRUE(std::filesystem::exists(run.path("point_cloud/notes.txt")));
}

// A disk that is not mounted, or a folder of another user.
TEST(RunFolder, IsNotTakenForEmptyWhereItsFoldersAreAway) {
  const TemporaryFolder folder;
  const RunFolder run(folder.path());
  EXPECT_NO_THROW(run.require_its_folders());
  std::filesystem::create_directory_symlink("/no/such/disk", run.path("checkpoints"));
  expect_error([&] { run.require_its_folders(); },
               {"checkpoints is a link to /no/such/disk, which does not exist"});
  std::filesystem::remove(run.path("checkpoints"));
  folder.write("point_cloud", "a file");
  expect_error([&] { run.require_its_folders(); }, {"cannot list", "point_cloud"});
  std::filesystem::remove(run.path("point_cloud"));
  for (const char* name : {"flow", "frames", "test"}) {
    std::filesystem::create_directory_symlink("/no/such/disk", run.path(name));
    expect_error([&] { run.require_its_folders(); },
                 {std::string(name) + " is a link to /no/such"});
    std::filesystem::remove(run.path(name));
  }
}

// The folder may come from an untrusted source.
TEST(RunFolder, ForgetsALinkToStaleCachesAndNotWhatItLeadsTo) {
  const TemporaryFolder folder, documents;
  const RunFolder run = RunFolder::create(folder.path());
  documents.write("thesis.txt", "");
  folder.write("frames/0.png", "");
  std::filesystem::create_directory_symlink(documents.path(), run.path("flow"));
  run.remove_stale_caches("a");
  EXPECT_FALSE(std::filesystem::is_symlink(run.path("flow")));
  EXPECT_FALSE(std::filesystem::exists(run.path("frames")));
  EXPECT_EQ(documents.count(), 1u);
}

TEST(RunFolder, HoldsATrainingWhereAnythingOfOneIsWorthKeeping) {
  for (const char* name : {"checkpoints/iteration_1.npz", "training.json", "results_train.json",
                           "point_cloud/iteration_1/point_cloud.ply", "test/a.png"}) {
    const TemporaryFolder folder;
    const RunFolder run = RunFolder::create(folder.path());
    for (const char* begun : {"config.toml", "input.ply", "metrics.jsonl"}) folder.write(begun, "");
    EXPECT_FALSE(run.holds_training());
    folder.write(name, "");
    EXPECT_TRUE(run.holds_training()) << name;
  }
}

// `gflow render` may be writing into its own folder there.
TEST(RunFolder, LeavesWhatOthersAreWriting) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  const pid_t other = ::fork();
  if (other == 0) {
    ::pause();
    ::_exit(0);
  }
  const std::string living = "checkpoints/.iteration_1." + std::to_string(other) + "-0.part.npz",
                    left = "checkpoints/.iteration_1.1-0.part.npz",
                    drawn = "pictures/rgb/.a.1-0.part.png";
  for (const std::string& name : {living, left, drawn}) folder.write(name, "");
  run.forget_unfinished_files();
  EXPECT_TRUE(std::filesystem::exists(run.path(living)));
  EXPECT_FALSE(std::filesystem::exists(run.path(left)));
  EXPECT_TRUE(std::filesystem::exists(run.path(drawn)));
  ::kill(other, SIGKILL);
  ::waitpid(other, nullptr, 0);
  run.forget_unfinished_files();
  EXPECT_FALSE(std::filesystem::exists(run.path(living)));
}

TEST(RunFolder, KnowsWhatItWouldForgetThroughLinks) {
  const TemporaryFolder folder, other;
  const RunFolder run(folder.path());
  EXPECT_FALSE(run.would_remove(folder.path()));
  EXPECT_FALSE(run.would_remove(folder.path() + "/pictures"));
  EXPECT_TRUE(run.would_remove(folder.path() + "/test/"));
  std::filesystem::create_directory(folder.path() + "/frames");
  std::filesystem::create_directory_symlink(folder.path() + "/frames", other.path() + "/link");
  EXPECT_TRUE(run.would_remove(other.path() + "/link/cam01"));
  EXPECT_FALSE(run.would_remove(other.path() + "/pictures"));
  std::filesystem::create_directory_symlink(other.path(), folder.path() + "/flow");
  EXPECT_TRUE(run.would_remove(folder.path() + "/flow/pictures"));
}

TEST(RunFolder, KnowsTheResultsOfEverySplit) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  for (const char* name : {"results.json", "results_train.json", "per_view_val.json",
                           "results_iteration_300.json", "per_view_val_iteration_300.json"})
    folder.write(name, "{}");
  folder.write("results_paper.json", "of a user");
  EXPECT_EQ(run.results().size(), folder.count() - 1);
  for (const std::string& path : run.results()) EXPECT_EQ(path.find("paper"), path.npos) << path;
}

TEST(RunFolder, IsOpenedOnlyWhereThereIsAConfiguration) {
  const TemporaryFolder folder;
  expect_error([&] { RunFolder::open(folder.path()); }, {folder.path(), "config.toml"});
  RunFolder::create(folder.path()).write_config({});
  EXPECT_NO_THROW(RunFolder::open(folder.path()));
}

TEST(RunFolder, IsNotOpenedWhileATrainingBeginsThere) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path() + "/run");
  {
    const FileLock lock = run.lock();
    expect_error([&] { RunFolder::open(run.folder()); },
                 {run.folder(), "being written by process"});
  }
  expect_error([&] { RunFolder::open(run.folder()); }, {run.folder(), "no config.toml"});
  EXPECT_NO_THROW(RunFolder::require_no_beginning(run.folder()));
}

TEST(RunFolder, ConfigurationComesBack) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  TrainOptions config;
  config.flow.weight = 0.125f;
  config.scene.path = "a \"quoted\" path";
  run.write_config(config);
  EXPECT_EQ(to_toml(run.read_config()), to_toml(config));
}

// As after a full disk; an empty file would silently mean default settings.
TEST(RunFolder, AnEmptyConfigurationIsRefused) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  folder.write("config.toml", "");
  expect_error([&] { run.read_config(); }, {"config.toml", "is empty"});
}

TEST(RunFolder, ModelsAreInTheOrderOfTheirIterationsNotOfTheirNames) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  for (const int iteration : {3, 900, 10000}) {
    const std::string path = run.model_path(iteration);
    std::filesystem::create_directories(std::filesystem::path(path).parent_path());
    std::ofstream(path) << "ply";
  }
  std::filesystem::create_directories(run.path("point_cloud/iteration_20000"));  // without a model
  std::filesystem::create_directories(run.path("point_cloud/other"));
  EXPECT_EQ(run.models(), (std::vector<int>{10000, 900, 3}));
}

// Otherwise a copy would be read in place of the model that its number names.
TEST(RunFolder, CopiesUnderOtherNamesAreNoModels) {
  const TemporaryFolder folder;
  for (const char* name : {"iteration_61", "iteration_0061", "iteration_ 8", "iteration_-5",
                           "iteration_007", "iteration_+3", "iteration_61.old", "iteration_61 "})
    folder.write(std::string("point_cloud/") + name + "/point_cloud.ply", "ply");
  EXPECT_EQ(RunFolder(folder.path()).models(), std::vector<int>{61});
}

TEST(RunFolder, MayHaveNoModelYet) {
  const TemporaryFolder folder;
  EXPECT_TRUE(RunFolder::create(folder.path()).models().empty());
}

TEST(RunFolder, ForgetsModelsOfAnEarlierTraining) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  for (const int iteration : {100, 200}) {
    std::filesystem::create_directories(
        std::filesystem::path(run.model_path(iteration)).parent_path());
    std::ofstream(run.model_path(iteration)) << "ply";
  }
  run.remove_model(200);
  run.remove_model(300);  // does not exist
  EXPECT_EQ(run.models(), std::vector<int>{100});
  EXPECT_EQ(folder.count(), 1u);
}

TEST(RunFolder, MetricsThatDoNotFitLeaveNoHalfALine) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  run.append_metrics(0, 1, {});
  const std::string one = contents(run.path("metrics.jsonl"));
  {
    const FileSizeLimit limit(one.size() + 10);
    expect_error([&] { run.append_metrics(1, 2, {}); }, {"metrics.jsonl", "File too large"});
  }
  EXPECT_EQ(contents(run.path("metrics.jsonl")), one);
}

TEST(RunFolder, CachesMadeUnderAnotherStampAreForgotten) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  run.remove_stale_caches("one");
  for (const char* name : {"flow", "frames"}) std::filesystem::create_directories(run.path(name));
  run.remove_stale_caches("one");
  EXPECT_TRUE(std::filesystem::exists(run.path("flow")));
  run.remove_stale_caches("two");
  EXPECT_FALSE(std::filesystem::exists(run.path("flow")));
  EXPECT_FALSE(std::filesystem::exists(run.path("frames")));
}

Evaluation some_evaluation() {
  Evaluation evaluation;
  ViewMetrics view;
  view.name = "cam00_0000";
  view.psnr = 31.5;
  view.ssim = 0.9;
  evaluation.views = {view};
  evaluation.mean = view;
  evaluation.flow_reference = "none";
  return evaluation;
}

TEST(RunFolder, ResultsHaveTheKeysThatScriptsRead) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  TrainOptions config;
  config.scene.resolution = 2;
  config.train.seed = 5;
  run.write_results(some_evaluation(), "test", {700, 12.5, 300, "a device", "bases"}, config, 42);
  const OrderedJson results = OrderedJson::parse(contents(run.path("results.json")));
  EXPECT_EQ(keys_of(results),
            (std::vector<std::string>{"test", "num_gaussians", "iterations", "train_seconds",
                                      "peak_memory_mib", "device", "motion", "resolution",
                                      "background", "seed"}));
  for (const char* key :
       {"psnr", "ssim", "psnr_dynamic", "ssim_dynamic", "flow_epe", "flow_epe_dynamic", "fl_all",
        "teacher_epe_dynamic", "depth_error", "flicker", "lpips", "clip", "flow_reference", "views",
        "trained_on", "lpips_model", "clip_model"})
    EXPECT_TRUE(results["test"].contains(key)) << key;
  EXPECT_EQ(results["test"]["psnr"], 31.5);
  EXPECT_TRUE(results["test"]["flow_epe"].is_null());  // not NaN, which is invalid in JSON
  for (const char* key : {"fl_all", "depth_error", "lpips", "lpips_model", "clip_model"})
    EXPECT_TRUE(results["test"][key].is_null()) << key;
  EXPECT_EQ(results["test"]["views"], 1);
  EXPECT_EQ(results["num_gaussians"], 42);
  EXPECT_EQ(results["iterations"], 700);
  EXPECT_EQ(results["train_seconds"], 12.5);
  EXPECT_EQ(results["device"], "a device");
  EXPECT_EQ(results["resolution"], 2);
  EXPECT_EQ(results["background"], "white");
  EXPECT_EQ(results["seed"], 5);
}

TEST(RunFolder, ResultsNameTheNetworksThatJudged) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  Evaluation evaluation = some_evaluation();
  evaluation.lpips_model = "nets/alex.onnx";
  evaluation.mean.lpips = 0.25;
  evaluation.clip_model = "nets/\xff.onnx";  // a path need not be UTF-8
  run.write_results(evaluation, "test", {}, {}, 1);
  const OrderedJson test = OrderedJson::parse(contents(run.path("results.json")))["test"];
  EXPECT_EQ(test["lpips"], 0.25);
  EXPECT_EQ(test["lpips_model"], "nets/alex.onnx");
  EXPECT_TRUE(test["clip_model"].is_string());
}

TEST(RunFolder, PerViewFiguresStandUnderTheNamesOfTheViews) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  run.write_results(some_evaluation(), "test", {}, {}, 1);
  const OrderedJson views = OrderedJson::parse(contents(run.path("per_view.json")));
  EXPECT_EQ(keys_of(views), (std::vector<std::string>{"cam00_0000"}));
  EXPECT_EQ(views["cam00_0000"]["psnr"], 31.5);
}

TEST(RunFolder, FactsOfTheTrainingComeBack) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  EXPECT_EQ(run.read_facts().iterations, 0);  // nothing written so far
  run.write_facts({30, 1.5, 300, "some device", "bases"});
  EXPECT_EQ(run.read_facts().iterations, 30);
  EXPECT_EQ(run.read_facts().train_seconds, 1.5);
  EXPECT_EQ(run.read_facts().peak_memory_mib, 300);
  EXPECT_EQ(run.read_facts().device, "some device");
  EXPECT_EQ(run.read_facts().motion, "bases");
}

TEST(RunFolder, DamagedFactsAreAsNoFacts) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  for (const std::string& text :
       std::vector<std::string>{"{\"iterations\": 30", "[1]", "{\"iterations\": \"many\"}", "",
                                "{\"iterations\": -5, \"finished\": true}",
                                "{\"iterations\": 1e300, \"finished\": true}",
                                std::string(200, '[') + std::string(200, ']')}) {
    for (const char* name : {"training.json", "results.json"}) folder.write(name, text);
    EXPECT_EQ(run.read_facts().iterations, 0) << text;
    EXPECT_FALSE(run.read_facts().finished) << text;
    EXPECT_EQ(run.judged_by().lpips, "") << text;
  }
  std::filesystem::remove(folder.path() + "/training.json");
  std::filesystem::create_directory(folder.path() + "/training.json");
  EXPECT_EQ(run.read_facts().iterations, 0);  // the model still exists
}

// They would take more memory than the run.
TEST(RunFolder, ReportsAndStampsThatGoOnForLongAreDamaged) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  run.write_facts({30, 1.5, 300, "some device", "bases"});
  run.remove_stale_caches("stamp");
  folder.write("results.json", R"({"test": {"lpips_model": "alex.onnx"}})");
  EXPECT_EQ(run.judged_by().lpips, "alex.onnx");
  ASSERT_TRUE(run.has_caches_of("stamp"));
  for (const char* name : {"training.json", "results.json", "caches.stamp"})
    std::ofstream(run.path(name), std::ios::app) << std::string(size_t{17} << 20, '\n');
  const double used = memory_of([&] {
    EXPECT_EQ(run.read_facts().iterations, 0);
    EXPECT_EQ(run.judged_by().lpips, "");
    EXPECT_FALSE(run.has_caches_of("stamp"));
  });
  EXPECT_LT(used, 8) << "they are not even read [MB]";
}

// A run without known facts would be missing in a table, or trained again.
TEST(RunFolder, FactsThatCannotBeReadAreAnError) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  run.write_facts({30, 1.5, 300, "some device", "bases"});
  std::filesystem::permissions(folder.path(), std::filesystem::perms(0755));
  std::filesystem::permissions(folder.path() + "/training.json", std::filesystem::perms::none);
  const uid_t root = ::geteuid();
  ASSERT_EQ(::seteuid(root == 0 ? 65534 : root), 0);  // root may read everything
  expect_error([&] { run.read_facts(); }, {"training.json", "Permission denied"});
  ASSERT_EQ(::seteuid(root), 0);
}

TEST(RunFolder, MetricsAreOneObjectALineAndStartAgainWithATraining) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  StepReport figures;
  figures.terms = {{"flow_loss", std::nan(""), ""}, {"psnr", 20, ""}};
  for (const int iteration : {0, 100, 0, 100, 200}) run.append_metrics(iteration, 1, figures);
  std::ifstream in(run.path("metrics.jsonl"));
  std::vector<OrderedJson> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(OrderedJson::parse(line));
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_EQ(lines[2]["iteration"], 200);
  EXPECT_EQ(lines[2]["psnr"], 20);
  EXPECT_TRUE(lines[2]["flow_loss"].is_null());
  std::ifstream csv(run.path("metrics.csv"));
  std::vector<std::string> rows;
  for (std::string row; std::getline(csv, row);) rows.push_back(row);
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_EQ(rows[0].rfind("iteration,seconds,loss,", 0), 0u);
  EXPECT_EQ(rows[3].rfind("200,1.0,0.0,", 0), 0u);
  EXPECT_NE(rows[3].find(",,20.0,"), std::string::npos);  // a missing value is an empty cell
  EXPECT_EQ(std::count(rows[0].begin(), rows[0].end(), ','),
            std::count(rows[3].begin(), rows[3].end(), ','));
  EXPECT_FALSE(lines[2].contains("rigidity"));
}

// As after an update of gflow: the columns of a table stay, whatever the order of new terms.
TEST(RunFolder, ATableOfMetricsKeepsItsColumns) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  StepReport report;
  report.terms = {{"a", 1, ""}, {"b", 2, ""}};
  run.append_metrics(0, 1, report);
  report.terms = {{"b", 20, ""}, {"c", 30, ""}, {"a", 10, ""}};
  run.append_metrics(10, 1, report);
  const std::string table = contents(run.path("metrics.csv"));
  EXPECT_NE(table.find(",a,b,"), std::string::npos) << table;
  EXPECT_NE(table.find(",10.0,20.0,"), std::string::npos) << table;
  run.keep_metrics_before(20);
  EXPECT_EQ(contents(run.path("metrics.csv")), table);

  std::ofstream(run.path("metrics.csv")) << "iteration,refused\n";
  report.rejected = 7;
  run.append_metrics(20, 1, report);
  EXPECT_EQ(contents(run.path("metrics.csv")), "iteration,refused\n20,7\n");
}

TEST(RunFolder, MetricsHaveAColumnForEachTerm) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  StepReport report;
  report.terms = {{"rigidity", 1, ""}, {"toy", 2, "toy 2"}};
  run.append_metrics(0, 1, report);
  const OrderedJson line = OrderedJson::parse(contents(run.path("metrics.jsonl")));
  EXPECT_EQ(line["rigidity"], 1);
  EXPECT_EQ(line["toy"], 2);
  EXPECT_NE(contents(run.path("metrics.csv")).find(",rigidity,toy,"), std::string::npos);
}

}  // namespace
}  // namespace gflow
