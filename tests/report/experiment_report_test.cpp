// SPDX-License-Identifier: Apache-2.0
#include "apps/report/experiment_report.hpp"

#include "tests/report/page_check.hpp"

namespace gflow::report {
namespace {

bool contains(const std::string& page, const std::string& text) {
  return page.find(text) != std::string::npos;
}

ExperimentReport small_experiment() {
  ExperimentReport report;
  report.title = "Does <flow> help?";
  report.date = "2026-01-31";
  report.summary = "4 of 4 runs. Means ± standard deviation over seeds.";
  report.axes = {"flow"};
  report.scenes = 1;
  report.runs = 4;
  report.baseline = "flow = off";
  report.table.head = {"scene", "flow", "PSNR [dB]"};
  report.table.rows = {{{"demo", "off"}, {{"29.48", "0.03", "", false}}},
                       {{"demo", "<on>"}, {{"29.92", "0.02", "+0.45", true}}}};
  report.costs.head = {"scene", "flow", "minutes"};
  report.costs.rows = {{{"demo", "off"}, {{"0.07", "", "", false}}}};
  report.bars = {{"PSNR [dB]", {{"off", 29.48, 0.03, 0}, {"<on>", 29.92, 0.02, 1}}, 2, 29}};
  report.curves = {{"demo", {{"off", {{0, 15}, {500, 28.37}}, 0, false}}}};
  const Image image{16, 8, 3, std::vector<uint8_t>(16 * 8 * 3, 50)};
  report.sheets = {{"demo", picture_of(image, 640)}};
  return report;
}

TEST(ExperimentReport, HasTableBarsCurvesAndSheets) {
  const std::string page = experiment_report_html(small_experiment());
  EXPECT_TRUE(contains(page, "<td>29.48 <small>± 0.03</small></td>"));
  EXPECT_TRUE(contains(page, "<td><b>29.92</b> <small>± 0.02</small> <small>(+0.45)</small></td>"));
  EXPECT_TRUE(contains(page, "the difference to flow = off"));
  EXPECT_TRUE(contains(page, "off: 29.48 ± 0.03"));
  EXPECT_TRUE(contains(page, "<b>28.37</b>"));
  EXPECT_TRUE(contains(page, "alt=\"Contact sheet demo\""));
  EXPECT_TRUE(contains(page, "0.07"));
}

TEST(ExperimentReport, IsAWholePageThatNeedsNoOtherFile) {
  const std::string page = experiment_report_html(small_experiment());
  expect_balanced(page);
  expect_self_contained(page);
  EXPECT_FALSE(contains(page, "<on>"));
  EXPECT_TRUE(contains(page, "Does &lt;flow&gt; help?"));
}

}  // namespace
}  // namespace gflow::report
