// SPDX-License-Identifier: Apache-2.0
// Metrics, results and facts in a run folder.
#include <unistd.h>

#include <nlohmann/json.hpp>

#include "optim/runs/run_folder.hpp"
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

TEST(RunRecords, KeepsMetricsOfTheStepsBeforeACheckpoint) {
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
TEST(RunRecords, MetricsThatNobodyWritesEndTheLogInLittleMemory) {
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

TEST(RunRecords, TheTableOfMetricsIsMendedFromTheirLines) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  StepReport report;
  report.terms = {{"flow_loss", std::nan(""), ""}, {"psnr", 1.0 / 3, ""}};
  for (const int iteration : {0, 10}) run.append_metrics(iteration, 1.25, report);
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
  run.append_metrics(20, 1, report);
  EXPECT_EQ(contents(run.path("metrics.csv")).rfind("iteration,", 0), 0u);
}

TEST(RunRecords, MetricsThatDoNotFitLeaveNoHalfALine) {
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

Evaluation some_evaluation() {
  Evaluation evaluation;
  ViewMetrics view;
  view.name = "cam00_0000";
  view.time = 0.25;
  view.psnr = 31.5;
  view.ssim = 0.9;
  evaluation.views = {view};
  evaluation.mean = view;
  evaluation.flow_reference = "none";
  return evaluation;
}

TEST(RunRecords, ResultsHaveTheKeysThatScriptsRead) {
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
  for (const char* key : {"psnr",           "psnr_matched",
                          "psnr_unfitted",  "ssim",
                          "psnr_dynamic",   "ssim_dynamic",
                          "flow_epe",       "flow_epe_dynamic",
                          "fl_all",         "teacher_epe_dynamic",
                          "depth_error",    "flicker",
                          "lpips",          "clip",
                          "flow_reference", "views",
                          "trained_on",     "fitted_cameras",
                          "lpips_model",    "clip_model"})
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

TEST(RunRecords, ResultsNameTheNetworksThatEvaluated) {
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

TEST(RunRecords, PerViewMetricsAreUnderTheNamesOfTheViews) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  run.write_results(some_evaluation(), "test", {}, {}, 1);
  const OrderedJson views = OrderedJson::parse(contents(run.path("per_view.json")));
  EXPECT_EQ(keys_of(views), (std::vector<std::string>{"cam00_0000"}));
  EXPECT_EQ(views["cam00_0000"]["psnr"], 31.5);
  EXPECT_EQ(views["cam00_0000"]["time"], 0.25);
}

TEST(RunRecords, FactsOfTheTrainingComeBack) {
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

TEST(RunRecords, DamagedFactsAreAsNoFacts) {
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
    EXPECT_EQ(run.metrics_options().lpips, "") << text;
  }
  std::filesystem::remove(folder.path() + "/training.json");
  std::filesystem::create_directory(folder.path() + "/training.json");
  EXPECT_EQ(run.read_facts().iterations, 0);  // the model still exists
}

// They would take more memory than the run.
TEST(RunRecords, ReportsAndStampsThatGoOnForLongAreDamaged) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  run.write_facts({30, 1.5, 300, "some device", "bases"});
  run.remove_stale_caches("stamp");
  folder.write("results.json", R"({"test": {"lpips_model": "alex.onnx"}})");
  EXPECT_EQ(run.metrics_options().lpips, "alex.onnx");
  ASSERT_TRUE(run.has_caches_of("stamp"));
  for (const char* name : {"training.json", "results.json", "caches.stamp"})
    std::ofstream(run.path(name), std::ios::app) << std::string(size_t{17} << 20, '\n');
  const double used = memory_of([&] {
    EXPECT_EQ(run.read_facts().iterations, 0);
    EXPECT_EQ(run.metrics_options().lpips, "");
    EXPECT_FALSE(run.has_caches_of("stamp"));
  });
  EXPECT_LT(used, 8) << "they are not even read [MB]";
}

// A run without known facts would be missing in a table, or trained again.
TEST(RunRecords, FactsThatCannotBeReadAreAnError) {
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

TEST(RunRecords, MetricsAreOneObjectALineAndStartAgainWithATraining) {
  const TemporaryFolder folder;
  const RunFolder run = RunFolder::create(folder.path());
  StepReport report;
  report.terms = {{"flow_loss", std::nan(""), ""}, {"psnr", 20, ""}};
  for (const int iteration : {0, 100, 0, 100, 200}) run.append_metrics(iteration, 1, report);
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
TEST(RunRecords, ATableOfMetricsKeepsItsColumns) {
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

TEST(RunRecords, MetricsHaveAColumnForEachTerm) {
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
