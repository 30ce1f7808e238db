// SPDX-License-Identifier: Apache-2.0
#include "apps/report/chart.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "apps/report/html.hpp"
#include "runtime/base/printable.hpp"

namespace gflow::report {
namespace {

// [SVG units], about one pixel each on screen and phone
constexpr double kWidth = 360, kHeight = 190;
constexpr double kLeft = 40, kRight = 10, kTop = 8, kBottom = 30;
constexpr size_t kMostDots = 120;

// Text of an axis: 0.5, 200, 50k.
std::string short_number(double value) {
  if (std::fabs(value) >= 1e6) return fmt::format("{:g}M", value / 1e6);
  if (std::fabs(value) >= 1e4) return fmt::format("{:g}k", value / 1e3);
  return fmt::format("{:g}", std::fabs(value) < 1e-12 ? 0 : value);
}

// The smallest of 1, 2, 5 x 10^k that is at least `value`.
double round_step(double value) {
  const double decade = std::pow(10, std::floor(std::log10(value)));
  for (const double step : {1., 2., 5.})
    if (step * decade >= value * (1 - 1e-9)) return step * decade;
  return 10 * decade;
}

// Range of an axis and what is written at it.
struct Axis {
  double low = 0, high = 1;
  bool log = false;
  std::vector<double> ticks;

  // Position of a value, 0 at the low end and 1 at the high one.
  double at(double value) const {
    return log ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
  }
};

Axis linear_axis(double low, double high, double about) {
  // Equal values, which may differ by rounding.
  if (!(high - low > 1e-9 * std::max(std::fabs(low), std::fabs(high)))) {
    const double room = std::max(std::fabs(low) * 0.01, 1e-3);
    low -= room;
    high += room;
  }
  Axis axis{low, high, false, {}};
  const double step = round_step((high - low) / about);
  for (double k = std::ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k)
    axis.ticks.push_back(k * step);
  return axis;
}

Axis log_axis(double low, double high) {
  if (!(high > low * 1.01)) low /= 1.5, high *= 1.5;
  Axis axis{low, high, true, {}};
  const bool few = high / low < 100;
  for (double decade = std::pow(10, std::floor(std::log10(low))); decade <= high; decade *= 10)
    for (const double step : {1., 2., 5.})
      if ((few || step == 1) && step * decade >= low && step * decade <= high)
        axis.ticks.push_back(step * decade);
  return axis;
}

// Extremes of some numbers.
struct Extent {
  double low = HUGE_VAL, high = -HUGE_VAL;
  void add(double value) {
    low = std::min(low, value);
    high = std::max(high, value);
  }
};

bool is_shown(const LineChart& chart, double y) {
  return std::isfinite(y) && (!chart.log || y > 0);
}

// What a chart of lines is drawn with.
struct Frame2D {
  Axis x, y;
  double px(double value) const { return kLeft + x.at(value) * (kWidth - kLeft - kRight); }
  double py(double value) const {
    return kHeight - kBottom - y.at(value) * (kHeight - kTop - kBottom);
  }
};

std::string axes_svg(const Frame2D& frame, const std::string& x_name) {
  std::string text = "<g class=\"axes\">";
  for (const double tick : frame.y.ticks) {
    const double y = frame.py(tick);
    text += fmt::format(
        "<path d=\"M{:.1f} {:.1f}H{:.1f}\"/><text x=\"{:.1f}\" y=\"{:.1f}\" "
        "text-anchor=\"end\">{}</text>",
        kLeft, y, kWidth - kRight, kLeft - 6, y + 3.5, short_number(tick));
  }
  const double floor = kHeight - kBottom;
  for (const double tick : frame.x.ticks)
    text += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>",
                        frame.px(tick), floor + 14, short_number(tick));
  return text + fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text></g>\n",
                            kWidth - kRight, kHeight - 3, escaped(x_name));
}

std::string line_svg(const LineChart& chart, const Frame2D& frame, const Series& series) {
  std::string path;
  size_t points = 0;
  for (const auto& [x, y] : series.points)
    if (is_shown(chart, y)) {
      path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? 'M' : 'L', frame.px(x), frame.py(y));
      ++points;
    }
  if (points == 1) path += "h0";  // its round ends make a dot
  return path.empty() ? ""
                      : fmt::format("<path class=\"{}{}\" stroke=\"{}\" d=\"{}\"/>\n",
                                    series.faint ? "faint" : "line", points == 1 ? " dot" : "",
                                    color_of(series.color), path);
}

std::string dots_svg(const LineChart& chart, const Frame2D& frame, const Series& series) {
  std::string text;
  const std::string before = series.name.empty() ? "" : escaped(series.name) + ", ";
  for (const auto& [x, y] : series.points)
    if (is_shown(chart, y))
      text += fmt::format(
          "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.2\" fill=\"{}\"><title>{}{} {:g}: {} {}"
          "</title></circle>\n",
          frame.px(x), frame.py(y), color_of(series.color), before, escaped(chart.x_name), x,
          number(y, chart.digits), escaped(chart.unit));
  return text;
}

std::string band_svg(const LineChart& chart, const Frame2D& frame, const Band& band) {
  std::string path;
  const auto add = [&](const std::pair<double, double>& point) {
    if (is_shown(chart, point.second))
      path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? 'M' : 'L', frame.px(point.first),
                          frame.py(point.second));
  };
  std::for_each(band.low.begin(), band.low.end(), add);
  std::for_each(band.high.rbegin(), band.high.rend(), add);
  return path.empty() ? ""
                      : fmt::format("<path class=\"band\" fill=\"{}\" d=\"{}Z\"/>\n",
                                    color_of(band.color), path);
}

// The last shown value of a series; NaN if there is none.
double last_of(const LineChart& chart, const Series& series) {
  for (auto point = series.points.rbegin(); point != series.points.rend(); ++point)
    if (is_shown(chart, point->second)) return point->second;
  return std::nan("");
}

std::string legend_html(const LineChart& chart) {
  std::string items, alone;
  size_t count = 0;
  for (const Series& series : chart.series) {
    if (series.name.empty()) continue;
    ++count;
    items += fmt::format(
        "<li><i style=\"border-color:{}\"></i>{}{}</li>", color_of(series.color),
        escaped(series.name),
        chart.dots ? "" : fmt::format(" <b>{}</b>", number(last_of(chart, series), chart.digits)));
  }
  return count == 0 ? "" : "<ul class=\"legend\">" + items + "</ul>\n";
}

// What the chart shows, for those who cannot see it.
std::string in_words(const LineChart& chart) {
  std::string text = fmt::format("Line chart of {} over {}", chart.title, chart.x_name);
  const char* before = ":";
  for (const Series& series : chart.series) {
    if (series.faint) continue;
    const double last = last_of(chart, series);
    Extent extent;
    for (const auto& [x, y] : series.points)
      if (is_shown(chart, y)) extent.add(y);
    if (!std::isfinite(last)) continue;
    text +=
        fmt::format("{}{} from {} to {}, at the end {}", before,
                    series.name.empty() ? "" : " " + series.name, number(extent.low, chart.digits),
                    number(extent.high, chart.digits), number(last, chart.digits));
    before = ";";
  }
  return text;
}

std::string figure(const std::string& heading, const std::string& body) {
  return fmt::format("<figure class=\"chart\">\n<figcaption>{}</figcaption>\n{}</figure>\n",
                     heading, body);
}

}  // namespace

std::string color_of(size_t number) {
  constexpr std::array colors{"#1769aa", "#d9480f", "#2b8a3e", "#862e9c",
                              "#a67c00", "#0b7285", "#c2255c", "#495057"};
  return colors[number % colors.size()];
}

Points thinned(const Points& points, size_t most) {
  if (points.size() <= most || most == 0) return points;
  const size_t each = (points.size() + most - 1) / most;
  Points result;
  for (size_t i = 0; i < points.size(); i += each) {
    const size_t end = std::min(points.size(), i + each);
    double x = 0, y = 0;
    for (size_t k = i; k < end; ++k) x += points[k].first, y += points[k].second;
    result.emplace_back(x / double(end - i), y / double(end - i));
  }
  return result;
}

Points smoothed(const Points& points) {
  const size_t reach = points.size() / kFewestSmoothed;
  Points result = points;
  for (size_t i = 0; i < points.size(); ++i) {
    const size_t near = std::min({reach, i, points.size() - 1 - i});  // the ends stay as they are
    double sum = 0;
    for (size_t k = i - near; k <= i + near; ++k) sum += points[k].second;
    result[i].second = sum / double(2 * near + 1);
  }
  return result;
}

std::string line_chart(const LineChart& chart) {
  Extent x, y;
  size_t most = 0;
  const auto take = [&](const Points& points) {
    size_t shown = 0;
    for (const auto& point : points)
      if (is_shown(chart, point.second)) x.add(point.first), y.add(point.second), ++shown;
    most = std::max(most, shown);
  };
  for (const Series& series : chart.series) take(series.points);
  for (const Band& band : chart.bands) take(band.low), take(band.high);
  if (most == 0) return "";
  if (chart.from_zero) y.add(0);
  const double room = chart.log ? 0 : 0.04 * (y.high - y.low);
  const Frame2D frame{linear_axis(x.low, x.high, 5),
                      chart.log
                          ? log_axis(y.low, y.high)
                          : linear_axis(chart.from_zero ? y.low : y.low - room, y.high + room, 4)};
  std::string svg = fmt::format("<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">\n",
                                kWidth, kHeight, escaped(in_words(chart)));
  svg += axes_svg(frame, chart.x_name);
  for (const Band& band : chart.bands) svg += band_svg(chart, frame, band);
  for (const bool faint : {true, false})
    for (const Series& series : chart.series)
      if (series.faint == faint) svg += line_svg(chart, frame, series);
  if (chart.dots && most <= kMostDots)
    for (const Series& series : chart.series)
      if (!series.faint) svg += dots_svg(chart, frame, series);
  svg += "</svg>\n";
  const std::string unit =
      chart.unit.empty() ? "" : fmt::format(" <span>{}</span>", escaped(chart.unit));
  return figure(escaped(chart.title) + unit, svg + legend_html(chart));
}

std::string bar_chart(const BarChart& chart) {
  constexpr double row = 34, thick = 9, room_for_value = 110;
  Extent extent;
  extent.add(chart.start);
  for (const Bar& bar : chart.bars)
    if (std::isfinite(bar.value))
      extent.add(bar.value + (std::isfinite(bar.spread) ? bar.spread : 0));
  if (!(extent.high > chart.start)) return "";
  const double height = row * double(chart.bars.size()) + 4;
  const auto at = [&](double value) {
    const double share = (value - chart.start) / (extent.high - chart.start);
    return std::max(0.0, share) * (kWidth - room_for_value);
  };
  std::string svg =
      fmt::format("<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"Bars of {}\">\n", kWidth,
                  height, escaped(chart.title));
  for (size_t i = 0; i < chart.bars.size(); ++i) {
    const Bar& bar = chart.bars[i];
    const double top = row * double(i), middle = top + 18 + thick / 2;
    const bool spreads = std::isfinite(bar.spread) && bar.spread > 0;
    std::string value = number(bar.value, chart.digits);
    if (spreads) value += " ± " + number(bar.spread, chart.digits);
    svg += fmt::format("<g><title>{0}: {1}</title><text x=\"0\" y=\"{2:.1f}\">{3}</text>",
                       escaped(bar.name), value, top + 13, escaped(excerpt(bar.name, 58)));
    double end = 0;
    if (std::isfinite(bar.value)) {
      end = at(bar.value);
      svg += fmt::format("<rect x=\"0\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{}\" fill=\"{}\"/>",
                         top + 18, std::max(end, 0.5), thick, color_of(bar.color));
    }
    if (spreads) {
      const double from = at(bar.value - bar.spread), to = at(bar.value + bar.spread);
      svg += fmt::format(
          "<path class=\"whisker\" d=\"M{0:.1f} {2:.1f}H{1:.1f}M{0:.1f} {3:.1f}V{4:.1f}M{1:.1f} "
          "{3:.1f}V{4:.1f}\"/>",
          from, to, middle, middle - 3, middle + 3);
      end = std::max(end, to);
    }
    svg += fmt::format("<text class=\"value\" x=\"{:.1f}\" y=\"{:.1f}\">{}</text></g>\n", end + 6,
                       middle + 4, value);
  }
  svg += "</svg>\n";
  const std::string start = chart.start == 0 ? ""
                                             : fmt::format(" <span>bars begin at {}</span>",
                                                           number(chart.start, chart.digits));
  return figure(escaped(chart.title) + start, svg);
}

}  // namespace gflow::report
