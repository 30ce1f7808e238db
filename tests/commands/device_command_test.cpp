// SPDX-License-Identifier: Apache-2.0
// `gflow devices` and `gflow stress`: their reports about correct and faulty devices.
#include <algorithm>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>

#include "runtime/cl/device.hpp"
#include "tests/support/command.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

using nlohmann::json;

constexpr const char* kOkWord = "  ok\n";

size_t lines_with(const std::string& text, const std::string& part) {
  size_t count = 0;
  for (size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

// Joins wrapped lines.
std::string in_one_line(const std::string& text) {
  return std::regex_replace(text, std::regex("\\s+"), " ");
}

TEST(DevicesCommand, TellsOfEachDeviceWhatItIsAndHowItCheckedItself) {
  const std::vector<DeviceInfo> devices = list_devices();
  const Outcome table = gflow({"devices"}), as_json = gflow({"devices", "--json"});
  ASSERT_EQ(table.code, 0) << table.err;
  ASSERT_EQ(as_json.code, 0) << as_json.err;
  const json told = json::parse(as_json.out);
  ASSERT_EQ(told.size(), devices.size());
  const json later = json::parse(gflow({"devices", "--json"}).out);
  ASSERT_EQ(later.size(), devices.size());
  for (size_t i = 0; i < devices.size(); ++i) {
    const json& one = told[i];
    EXPECT_EQ(one["index"], devices[i].index);
    EXPECT_EQ(one["name"], devices[i].name);
    EXPECT_EQ(one["lanes"], devices[i].lanes);
    // The memory of a virtual machine may grow between processes.
    const auto [least, most] =
        std::minmax<uint64_t>({devices[i].global_memory, later[i]["memory_bytes"]});
    EXPECT_GE(one["memory_bytes"], least);
    EXPECT_LE(one["memory_bytes"], most);
    EXPECT_EQ(one["usable"], one["reason"] == "") << one["reason"];
    EXPECT_NE(table.out.find(devices[i].name), std::string::npos);
  }
  // The tests run on the first device, so it must be usable.
  EXPECT_GE(told[0]["self_check"].size(), 7u);
  for (const json& row : told[0]["self_check"]) {
    EXPECT_TRUE(row["passed"]) << row;
    EXPECT_LE(row["figure"], row["bound"]) << row;
    EXPECT_NE(table.out.find(row["name"].get<std::string>()), std::string::npos) << row;
  }
  EXPECT_EQ(lines_with(table.out, "\n   usable\n"), lines_with(as_json.out, "\"usable\": true"));
}

TEST(DevicesCommand, ShowsTheOneAskedForAndRefusesOneThereIsNot) {
  const Outcome first = gflow({"devices", "--json", "--device", "0"});
  ASSERT_EQ(first.code, 0) << first.err;
  const json told = json::parse(first.out);
  ASSERT_EQ(told.size(), 1u);
  EXPECT_EQ(told[0]["index"], 0);

  const Outcome none = gflow({"devices", "--device", "no such device"});
  EXPECT_EQ(none.code, 2);
  EXPECT_EQ(none.out, "");
  EXPECT_NE(none.err.find("no OpenCL device matches 'no such device'"), std::string::npos);
  EXPECT_NE(none.err.find("0: " + list_devices()[0].full_name()), std::string::npos) << none.err;
}

// The kernels of the source tree with one changed line that makes the arithmetic wrong.
class ChangedKernels {
 public:
  ChangedKernels(const std::string& file, const std::string& from, const std::string& to) {
    fs::copy(GFLOW_SOURCE_DIR "/kernels", folder_.path(), fs::copy_options::recursive);
    const std::string path = folder_.file(file);
    std::string text = contents(path);
    const size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from << " in " << file;
    if (at != std::string::npos) text.replace(at, from.size(), to);
    std::ofstream(path) << text;
  }
  // Shell command that sets the environment.
  std::string environment() const { return "export GFLOW_KERNEL_DIR='" + folder_.path() + "'"; }

 private:
  TemporaryFolder folder_;
};

TEST(DevicesCommand, ADeviceWhoseArithmeticIsWrongIsRefusedForAnyWork) {
  const ChangedKernels kernels("checks/selfcheck.cl", "sqrt(positives[i]);",
                               "sqrt(positives[i]) * 1.00001f;");
  const Outcome outcome = gflow({"devices"}, kernels.environment());
  EXPECT_EQ(outcome.code, 2);
  EXPECT_EQ(lines_with(outcome.out, "unusable: float32 sqrt, error in ulp:"),
            list_devices().size());
  EXPECT_NE(outcome.err.find("is unusable: "), std::string::npos) << outcome.err;

  const Outcome work = gflow({"stress", "--only", "T5"}, kernels.environment());
  EXPECT_EQ(work.code, 2);
  EXPECT_NE(work.err.find("float32 sqrt, error in ulp"), std::string::npos) << work.err;
}

// For the first size PoCL reports a failed build; for the second its LLVM ends gflow.
TEST(DevicesCommand, AKernelThatCannotBeKeptIsNoFaultOfTheDevice) {
  if (!is_pocl(list_devices()[0])) GTEST_SKIP() << "PoCL alone keeps its programs in a folder";
  for (const char* kib : {"40", "200"}) {
    const TemporaryFolder folder;
    const Outcome outcome =
        gflow({"stress", "--derivatives"},
              fmt::format("export POCL_CACHE_DIR='{}'; ulimit -f {}", folder.path(), kib));
    EXPECT_EQ(outcome.code, 1) << kib;
    EXPECT_NE(outcome.err.find(folder.path() + ", where a file of 1 MiB"), std::string::npos)
        << kib << outcome.err;
  }
}

TEST(DevicesCommand, NoTemporaryFolderIsNoFaultOfTheDevice) {
  const TemporaryFolder folder;
  const std::string none = folder.path() + "/none";
  const Outcome outcome = gflow({"--quiet", "stress", "--only", "T28"}, "export TMPDIR=" + none);
  EXPECT_EQ(outcome.code, 1) << outcome.out;
  EXPECT_EQ(outcome.err.rfind("gflow: cannot create a temporary folder in " + none +
                                  " (from TMPDIR): No such file or directory; set TMPDIR to",
                              0),
            0u)
      << outcome.err;
}

// These errors are not the device's fault.
TEST(DevicesCommand, AVariableThatIsNoAnswerIsAnError) {
  for (const char* set : {"GFLOW_POISON_BUFFERS=yes", "GFLOW_SYNC=2", "GFLOW_KERNEL_DIR=/nowhere",
                          "GFLOW_DEVICE_TIMEOUT=soon"})
    for (const std::vector<std::string>& command :
         {std::vector<std::string>{"devices"}, {"stress", "--only", "T5"}}) {
      const Outcome outcome = gflow(command, std::string("export ") + set);
      EXPECT_EQ(outcome.code, 1) << set << outcome.err;
      const std::string name(set, std::string(set).find('='));
      EXPECT_NE(outcome.err.find(name + " is '"), std::string::npos) << outcome.err;
    }
}

TEST(StressCommand, WritesTheValuesThatItPrints) {
  const TemporaryFolder folder;
  const std::string path = folder.file("report.json");
  const Outcome outcome = gflow({"stress", "--only", "t05, 21", "--json", path});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const json told = json::parse(contents(path));
  EXPECT_EQ(told["failed"], 0);
  ASSERT_EQ(told["tests"].size(), 2u);
  EXPECT_EQ(told["tests"][0]["test"], "T5");
  EXPECT_EQ(told["tests"][1]["test"], "T21");
  const std::string shown = in_one_line(outcome.out);
  size_t rows = 0;
  for (const json& test : told["tests"])
    for (const json& row : test["values"]) {
      ++rows;
      EXPECT_TRUE(row["passed"]) << row;
      EXPECT_LE(row["figure"], row["bound"]) << row;
      EXPECT_NE(shown.find(row["condition"].get<std::string>()), std::string::npos) << row;
    }
  EXPECT_EQ(told["passed"], rows);
  EXPECT_EQ(lines_with(outcome.out, kOkWord), rows);
  EXPECT_NE(outcome.out.find(std::to_string(rows) + " of " + std::to_string(rows) + " values"),
            std::string::npos);
  EXPECT_NE(outcome.err.find("T21"), std::string::npos) << "progress";
  EXPECT_EQ(gflow({"--quiet", "stress", "--only", "5"}).err, "");
}

// The default width of a terminal, however long a condition is.
TEST(StressCommand, NoLineIsLongerThan80Characters) {
  for (const std::vector<std::string>& what :
       {std::vector<std::string>{"--only", "12,18,21,40", "--quick"}, {"--derivatives"}}) {
    std::vector<std::string> arguments{"--quiet", "stress"};
    arguments.insert(arguments.end(), what.begin(), what.end());
    std::istringstream lines(gflow(arguments).out);
    size_t count = 0;
    std::string line;
    std::getline(lines, line);  // skips the name of the device
    for (; std::getline(lines, line); ++count) EXPECT_LE(line.size(), 80u) << line;
    EXPECT_GT(count, 20u);
  }
}

TEST(StressCommand, ABoundThatIsNotKeptIsExitCodeThree) {
  const TemporaryFolder folder;
  const std::string path = folder.file("report.json");
  const ChangedKernels kernels("checks/stress.cl", "dets[i] = w.det;", "dets[i] = w.det * 1.001f;");
  const Outcome outcome =
      gflow({"--quiet", "stress", "--only", "T5", "--json", path}, kernels.environment());
  EXPECT_EQ(outcome.code, 3) << outcome.err;
  const size_t failed = json::parse(contents(path))["failed"];
  EXPECT_GT(failed, 0u);
  EXPECT_EQ(lines_with(outcome.out, "  FAILS\n"), 2 * failed) << "once more at the end";
}

// T35 has a quick part, which runs, and a slow one.
TEST(StressCommand, TellsWhatQuickLeavesOut) {
  const Outcome outcome = gflow({"--quiet", "stress", "--only", "5,35", "--quick"});
  EXPECT_EQ(outcome.code, 0) << outcome.out;
  EXPECT_NE(outcome.out.find("T35"), std::string::npos) << outcome.out;
  EXPECT_EQ(outcome.err,
            "gflow: warning: --quick skips T35 'the same, 1000 scenes', which --only names\n");
}

TEST(StressCommand, RefusesWhatItDoesNotKnow) {
  expect_refused({"stress", "--only", "T99"}, {"--only T99", "T5, ", "T42 to T45"});
  for (const char* word : {"T1-T3", "quick", "T"})
    expect_refused({"stress", "--only", word}, {fmt::format("--only: '{}' is not a number", word)});
  for (const std::string path : {"/nowhere/report.json", "/proc/report.json"})
    expect_refused({"stress", "--only", "5", "--json", path}, {"--json: cannot write " + path});
  EXPECT_NE(gflow({"stress", "--only", "5", "--derivatives"}).code, 0);
}

// A shell loop around it must end as well.
TEST(StressCommand, InterruptedInItsLastTestItSaysSo) {
  const Command command({"stress", "--only", "T22"});
  for (int i = 0; i < 6000 && command.said().find("T22 ") == std::string::npos; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  command.send(SIGTERM);
  const Outcome outcome = command.wait();
  EXPECT_EQ(outcome.code, 143);
  EXPECT_NE(outcome.err.find("the last test had begun"), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.out.find("T22 "), std::string::npos) << outcome.out;
}

TEST(StressCommand, InterruptedItKeepsTheValuesThatItHas) {
  const TemporaryFolder folder;
  const std::string path = folder.file("report.json");
  const Command command({"stress", "--json", path});
  for (int i = 0; i < 6000 && command.said().find("T2 ") == std::string::npos; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));  // until the first test has ended
  command.send(SIGINT);
  const Outcome outcome = command.wait();
  EXPECT_EQ(outcome.code, 130);
  EXPECT_NE(outcome.err.find("interrupted: "), std::string::npos) << outcome.err;
  EXPECT_NE(outcome.err.find(path), std::string::npos) << outcome.err;
  const json report = json::parse(contents(path));
  EXPECT_EQ(report["interrupted"], true);
  EXPECT_GE(report["tests"].size(), 1u);
  EXPECT_TRUE(report["derivatives"].empty());
}

}  // namespace
}  // namespace gflow
