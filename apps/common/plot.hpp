// SPDX-License-Identifier: Apache-2.0
// Plots, drawn by gnuplot.
#pragma once
#include <string>
#include <vector>

namespace gflow {

// A table and the gnuplot script that plots it.
struct Plot {
  std::string name, script;
  int width = 1000, height = 640;               // [px]
  std::vector<std::vector<std::string>> table;  // rows; the first one has the headings
};
// Stacked bars: one bar per row after the first, one segment per column. The first column names the
// bar, the first row names the segments.
Plot bars(const std::string& name, const std::string& what,
          std::vector<std::vector<std::string>> table);

// Writes script and data into `folder` (created if needed) as NAME.gnuplot and NAME.tsv, and runs
// the script for NAME.svg and NAME.png if gnuplot is installed. Returns a sentence: where the plot
// is, or how to draw it.
std::string draw(const Plot& plot, const std::string& folder);

}  // namespace gflow
