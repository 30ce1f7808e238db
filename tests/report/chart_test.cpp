// SPDX-License-Identifier: Apache-2.0
#include "apps/report/chart.hpp"

#include <cmath>

#include "apps/report/html.hpp"
#include "tests/report/page_check.hpp"

namespace gflow::report {
namespace {

LineChart chart_of(const Points& points) {
  LineChart chart;
  chart.title = "PSNR";
  chart.x_name = "step";
  chart.dots = true;
  chart.series.push_back({"a", points, 0, false});
  return chart;
}

size_t count(const std::string& text, const std::string& word) {
  size_t times = 0;
  for (size_t at = 0; (at = text.find(word, at)) != std::string::npos; ++at) ++times;
  return times;
}

TEST(LineChart, LeavesOutWhatIsNotFinite) {
  const std::string svg = line_chart(chart_of({{0, 1}, {1, std::nan("")}, {2, HUGE_VAL}, {3, 2}}));
  EXPECT_EQ(count(svg, "<circle"), 2u);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_EQ(svg.find("inf"), std::string::npos);
  expect_balanced(svg);
}

TEST(LineChart, IsNothingWithoutPoints) {
  EXPECT_EQ(line_chart(chart_of({})), "");
  EXPECT_EQ(line_chart(chart_of({{0, std::nan("")}})), "");
  LineChart chart = chart_of({{0, 0}, {1, -1}});
  chart.log = true;
  EXPECT_EQ(line_chart(chart), "");
}

TEST(LineChart, DrawsEqualValuesAndSinglePoints) {
  for (const Points& points :
       {Points{{5, 0}}, Points{{0, 3}, {1, 3}}, Points{{0, 0.9}, {1, std::nextafter(0.9, 1)}}})
    for (const bool log : {false, true}) {
      LineChart chart = chart_of(points);
      chart.log = log;
      const std::string svg = line_chart(chart);
      EXPECT_EQ(svg.find("nan"), std::string::npos);
      EXPECT_EQ(svg.find("inf"), std::string::npos);
      EXPECT_EQ(svg.find("dot") != std::string::npos, svg != "" && points.size() == 1);
    }
}

// The lower end of the axis is at 160 of 190, its upper one at 8.
TEST(LineChart, PutsValuesOnTheScale) {
  LineChart chart = chart_of({{0, 0}, {10, 100}});
  chart.from_zero = true;
  const std::string svg = line_chart(chart);
  EXPECT_NE(svg.find("cx=\"40.0\" cy=\"160.0\""), std::string::npos) << svg;
  EXPECT_NE(svg.find("<title>a, step 10: 100.00"), std::string::npos) << svg;
  EXPECT_NE(svg.find(">50</text>"), std::string::npos) << svg;
}

TEST(BarChart, HasValuesAndSpreads) {
  const std::string svg = bar_chart(
      {"PSNR [dB]", {{"a", 30, 0.5, 0}, {"<b>", 20, std::nan(""), 1}, {"c", NAN, NAN, 2}}, 1, 10});
  EXPECT_NE(svg.find("30.0 ± 0.5"), std::string::npos);
  EXPECT_NE(svg.find("&lt;b&gt;: 20.0"), std::string::npos);
  EXPECT_EQ(count(svg, "<rect"), 2u);
  EXPECT_EQ(count(svg, "whisker"), 1u);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  expect_balanced(svg);
  EXPECT_EQ(bar_chart({"PSNR", {{"a", NAN, NAN, 0}}, 1, 0}), "");
}

TEST(Smoothed, KeepsEndsAndMeanOfALine) {
  Points line;
  for (int i = 0; i < 100; ++i) line.emplace_back(i, 2 * i + (i % 2 ? 1 : -1));
  const Points smooth = smoothed(line);
  EXPECT_EQ(smooth.front(), line.front());
  EXPECT_EQ(smooth.back(), line.back());
  // Five neighbours: their mean is off by a fifth of the noise.
  EXPECT_NEAR(smooth[50].second, 100, 0.21);
  EXPECT_EQ(thinned(line, 50).size(), 50u);
  EXPECT_DOUBLE_EQ(thinned(line, 50)[1].second, 5);
  EXPECT_EQ(thinned(line, 200), line);
}

TEST(Numbers, AreShownInGroupsAndUnits) {
  EXPECT_EQ(grouped(1234567), "1\u202f234\u202f567");
  EXPECT_EQ(grouped(-1234), "-1\u202f234");
  EXPECT_EQ(grouped(999), "999");
  EXPECT_EQ(number(NAN, 2), "–");
  EXPECT_EQ(duration(89), "89 s");
  EXPECT_EQ(duration(90), "1.5 min");
  EXPECT_EQ(duration(7200), "2.0 h");
  EXPECT_EQ(counted(1, "view", "views"), "1 view");
}

}  // namespace
}  // namespace gflow::report
