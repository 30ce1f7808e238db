// SPDX-License-Identifier: Apache-2.0
#include "apps/report/run_report.hpp"

#include "apps/report/html.hpp"
#include "tests/report/page_check.hpp"

namespace gflow::report {
namespace {

bool has(const std::string& page, const std::string& text) {
  return page.find(text) != std::string::npos;
}

Image grey_image(int width, int height) {
  return {width, height, 3, std::vector<uint8_t>(size_t(3 * width * height), 100)};
}

ViewMetrics view_of(const std::string& name, int step, double psnr) {
  ViewMetrics view;
  view.name = name;
  view.step = step;
  view.time = step / 2.0;
  view.psnr = psnr;
  view.ssim = 0.9;
  return view;
}

// Two cameras with three steps each, without flow.
RunReport small_report() {
  RunReport report;
  report.title = report.run = "run";
  report.date = "2026-01-31";
  report.version = "0";
  report.scene = {"scene", "n3v", 30, 10, 10, 3, 64, 48};
  report.facts = {500, 100, 200, "a device", "spacetime", true};
  report.config.train.iterations = 500;
  report.evaluation.gaussians = 12345;
  report.evaluation.flow_reference = "none";
  report.evaluation.mean = view_of("", 0, 26.5);
  for (int camera = 0; camera < 2; ++camera) {
    report.cameras.push_back({"cam" + std::to_string(camera), {}});
    for (int step = 0; step < 3; ++step) {
      report.cameras.back().views.push_back(report.evaluation.views.size());
      report.evaluation.views.push_back(
          view_of("cam" + std::to_string(camera) + "_" + std::to_string(step), step,
                  20.25 + camera + step));
    }
  }
  const Picture picture = picture_of(grey_image(32, 24), 640);
  report.views.push_back({report.evaluation.views[0], picture, picture, picture, {}, {}});
  report.log = {{0, {{"loss", 0.5}, {"psnr", 10}, {"num_gaussians", 100}}},
                {100, {{"loss", 0.1}, {"psnr", 20}, {"num_gaussians", 200}}}};
  return report;
}

TEST(RunReport, IsAWholePageThatNeedsNoOtherFile) {
  const std::string page = run_report_html(small_report());
  expect_balanced(page);
  expect_self_contained(page);
  EXPECT_TRUE(has(page, "<html lang=\"en\">"));
  EXPECT_FALSE(has(page, "<img src=\"data:image/jpeg;base64,\""));
  EXPECT_FALSE(has(page, "alt=\"\""));
}

TEST(RunReport, IsTheSameForTheSameRun) {
  EXPECT_EQ(run_report_html(small_report()), run_report_html(small_report()));
}

TEST(RunReport, SaysWhatWasTrainedOnWhat) {
  const std::string page = run_report_html(small_report());
  EXPECT_TRUE(has(page, "30 images of 10 cameras at 3 time steps, 64 × 48 pixels"));
  EXPECT_TRUE(has(page, "500 steps in 1.7 min on a device"));
  EXPECT_TRUE(
      has(page, "6 views held back for testing from 2 cameras, which training has not seen"));
  EXPECT_TRUE(has(page, "<code>gflow view run</code>"));
}

TEST(RunReport, OfAStoppedRunSaysSoAtItsTop) {
  RunReport report = small_report();
  EXPECT_FALSE(has(run_report_html(report), "has not finished"));
  report.facts.finished = false;
  report.facts.iterations = 120;
  const std::string page = run_report_html(report);
  EXPECT_TRUE(has(page, "stopped after 120 of 500 steps"));
  EXPECT_LT(page.find("has not finished"), page.find("A moving scene"));
  expect_balanced(page);
}

TEST(RunReport, SaysWhyTheLastTimeStepHasNoFlow) {
  RunReport report = small_report();
  const auto page_of = [&](int step) {
    report.views[1].metrics.step = step;
    return run_report_html(report);
  };
  report.views.push_back(report.views[0]);
  EXPECT_FALSE(has(page_of(2), "No flow"));  // nor has any other view
  report.views[0].flow = report.views[0].truth;
  EXPECT_TRUE(has(page_of(2), "No flow: there is no later time step."));
  EXPECT_FALSE(has(page_of(1), "No flow"));
  expect_balanced(page_of(2));
}

TEST(RunReport, HasTheMetricsOfEachStep) {
  const std::string page = run_report_html(small_report());
  for (const char* value : {"cam0, time step 0: 20.25", "cam1, time step 2: 23.25", ">26.50<"})
    EXPECT_TRUE(has(page, value)) << value;
  EXPECT_TRUE(has(page, "worst of all by PSNR is <b>cam0_0</b>"));
  EXPECT_TRUE(has(page, "23.25 <small>cam1_2</small>"));  // the best
}

TEST(RunReport, NamesSettingsThatDifferFromTheDefaults) {
  RunReport report = small_report();
  report.config.flow.weight = 0.375f;
  const std::string page = run_report_html(report);
  EXPECT_TRUE(has(page, "<code>flow.weight</code>"));
  EXPECT_TRUE(has(page, "<b>0.375</b>"));
  EXPECT_TRUE(has(page, "<code>train.iterations</code>"));
  EXPECT_FALSE(has(page, "<code>flow.enabled</code>"));
}

TEST(RunReport, OfARunWithoutTestViewsSaysThatItShowsTrainingViews) {
  RunReport report = small_report();
  report.split = "train";
  const std::string page = run_report_html(report);
  EXPECT_TRUE(has(page, "The scene holds back no test views"));
  EXPECT_TRUE(has(page, "<h2>Training views</h2>"));
  EXPECT_FALSE(has(page, "6 test views"));
  expect_balanced(page);
}

TEST(RunReport, OfARunWithoutViewsOrLogIsAPage) {
  RunReport report = small_report();
  report.views.clear();
  report.log.clear();
  report.cameras.clear();
  report.evaluation = {};
  expect_balanced(run_report_html(report));
}

TEST(RunReport, ShowsFlowBesideReferenceFlowOnlyWhereThereIsFlow) {
  RunReport report = small_report();
  std::string page = run_report_html(report);
  EXPECT_FALSE(has(page, "reference flow"));
  EXPECT_FALSE(has(page, "Flow error"));
  report.views[0].flow = report.views[0].target = report.views[0].truth;
  report.flow_length = 7.5;
  report.evaluation.mean.flow_epe_dynamic = 1.25;
  page = run_report_html(report);
  EXPECT_TRUE(has(page, "<figcaption>reference flow</figcaption>"));
  EXPECT_TRUE(has(page, "strongest at 7.5 px"));
  EXPECT_TRUE(has(page, "<dt>Flow error, moving</dt><dd>1.250 <span>px</span></dd>"));
  expect_balanced(page);
}

TEST(RunReport, ShowsHostileNamesAsText) {
  const std::string hostile = "<script>alert('&\"')</script>\xff\x1b";
  RunReport report = small_report();
  report.title = report.scene.name = report.run = report.facts.device = report.facts.motion =
      report.driver = hostile;
  report.cameras[0].name = report.evaluation.views[0].name = report.views[0].metrics.name = hostile;
  report.scene.layout = report.version = report.date = hostile;
  report.notices = {hostile};
  report.config.init.file = hostile;
  report.log[0].values[hostile] = 1;
  const std::string page = run_report_html(report);
  EXPECT_FALSE(has(page, "<script>alert"));
  EXPECT_TRUE(has(page, "&lt;script&gt;alert(&#39;&amp;&quot;&#39;)&lt;/script&gt;\\xff\\x1b"));
  expect_balanced(page);
}

TEST(RunReport, DrawsTheRangeOfManyCameras) {
  RunReport report = small_report();
  report.cameras.clear();
  report.evaluation.views.clear();
  for (int camera = 0; camera < 9; ++camera) {
    report.cameras.push_back({"cam" + std::to_string(camera), {}});
    for (int step = 0; step < 3; ++step) {
      report.cameras.back().views.push_back(report.evaluation.views.size());
      report.evaluation.views.push_back(view_of("v", step, 20 + camera));
    }
  }
  const std::string page = run_report_html(report);
  EXPECT_TRUE(has(page, "mean over views, time step 1: 24.00"));
  EXPECT_TRUE(has(page, "class=\"band\""));
  EXPECT_FALSE(has(page, "cam3, time step"));
}

}  // namespace
}  // namespace gflow::report
