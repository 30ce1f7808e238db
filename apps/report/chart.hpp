// SPDX-License-Identifier: Apache-2.0
// Charts as inline SVG, with axes, a legend, and the values as titles that a browser shows under
// the pointer.
#pragma once
#include <string>
#include <utility>
#include <vector>

namespace gflow::report {

using Points = std::vector<std::pair<double, double>>;  // x, y

// A line. Points with a non-finite y are left out.
struct Series {
  std::string name;  // plain text; empty: no entry in the legend
  Points points;
  size_t color = 0;    // number of the colour
  bool faint = false;  // behind the others, without values
};
// The area between two lines of y at the same x.
struct Band {
  Points low, high;
  size_t color = 0;
};

struct LineChart {
  std::string title, x_name, unit;  // plain text; unit of y, or empty
  std::vector<Series> series;
  std::vector<Band> bands;
  int digits = 2;          // decimal places of shown values
  bool from_zero = false;  // the y axis begins at 0
  bool log = false;        // logarithmic y axis; values that are not positive are left out
  bool dots = false;       // a dot with its value at each point, if they are not too many
};
// A <figure>; empty if no series has a point.
std::string line_chart(const LineChart& chart);

// A horizontal bar.
struct Bar {
  std::string name;   // plain text
  double value = 0;   // NaN: no bar
  double spread = 0;  // half the length of the line across its end; NaN or 0: none
  size_t color = 0;
};
struct BarChart {
  std::string title;  // plain text, with the unit
  std::vector<Bar> bars;
  int digits = 2;
  double start = 0;  // where the axis begins
};
// A <figure>; empty if no bar has a value.
std::string bar_chart(const BarChart& chart);

// Mean over neighbours, a twentieth of the points wide; fewer points than kFewestSmoothed stay as
// they are.
constexpr size_t kFewestSmoothed = 40;
Points smoothed(const Points& points);
// Neighbours averaged until at most `most` points are left.
Points thinned(const Points& points, size_t most);

// Colours that differ also for colour-blind readers, repeated after eight.
std::string color_of(size_t number);

}  // namespace gflow::report
