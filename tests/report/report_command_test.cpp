// SPDX-License-Identifier: Apache-2.0
// Reports as the commands write them.
#include "tests/report/page_check.hpp"
#include "tests/support/command_scene.hpp"

namespace gflow {
namespace {

class ReportCommand : public CommandTest {};

bool is_in(const std::string& page, const std::string& text) {
  return page.find(text) != std::string::npos;
}

TEST_F(ReportCommand, TrainWritesTheReportOfItsRun) {
  EXPECT_TRUE(is_in(trained().out, "report    " + run() + "/report.html\n")) << trained().out;
  const std::string page = contents(run() + "/report.html");
  expect_balanced(page);
  expect_self_contained(page);
  EXPECT_TRUE(is_in(page, "15 images of 3 cameras at 5 time steps, 48 × 40 pixels"));
  EXPECT_TRUE(is_in(page, "5 views held back for testing from 1 camera"));
  EXPECT_TRUE(is_in(page, "Render of cam00_0000, time step 0"));
  EXPECT_TRUE(is_in(page, "<figcaption>reference flow</figcaption>"));
  EXPECT_LT(page.size(), size_t{3} << 20);
}

TEST_F(ReportCommand, EvalRenewsIt) {
  const TemporaryFolder folder;
  const std::string copy = folder.path() + "/copy";
  fs::copy(run(), copy, fs::copy_options::recursive);
  std::ofstream(copy + "/report.html") << "old";
  ASSERT_EQ(gflow({"eval", copy, "--split", "train", "--quiet"}).code, 0);
  EXPECT_EQ(contents(copy + "/report.html"), "old");    // of the test views
  EXPECT_EQ(contents(copy + "/notices.json"), "[]\n");  // training had no warning
  std::ofstream(copy + "/notices.json") << "[\"a warning of the training\"]";
  ASSERT_EQ(gflow({"eval", copy, "--quiet"}).code, 0);
  EXPECT_TRUE(is_in(contents(copy + "/report.html"), "<code>gflow view copy</code>"));
  EXPECT_TRUE(is_in(contents(copy + "/report.html"), "<li>a warning of the training</li>"));
}

TEST_F(ReportCommand, WithoutTestViewsItShowsTrainingViews) {
  const TemporaryFolder folder;
  const std::string other = folder.path() + "/other";
  const Outcome outcome =
      gflow({"train", scene().path(), "-o", other, "--iterations", "1", "--quiet", "--set",
             "scene.holdout=-1", "--set", "flow.enabled=false"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const std::string page = contents(other + "/report.html");
  expect_balanced(page);
  EXPECT_TRUE(is_in(page, "The scene holds back no test views"));
  EXPECT_TRUE(is_in(page, "20 training views"));
  EXPECT_TRUE(is_in(page, "<code>scene.holdout</code>"));
}

// The training is complete without its report.
TEST_F(ReportCommand, AReportThatCannotBeWrittenIsAWarning) {
  const TemporaryFolder folder;
  const std::string copy = folder.path() + "/copy";
  fs::copy(run(), copy, fs::copy_options::recursive);
  fs::remove(copy + "/report.html");
  fs::create_directory(copy + "/report.html");
  const Outcome outcome = gflow({"eval", copy, "--quiet"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_TRUE(is_in(outcome.err, "report.html not written: ")) << outcome.err;
  EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1) << outcome.err;
  EXPECT_FALSE(is_in(outcome.out, "report    "));
}

}  // namespace
}  // namespace gflow
