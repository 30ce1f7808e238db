// SPDX-License-Identifier: Apache-2.0
// Pictures of numbers, by gnuplot.
#pragma once
#include <string>
#include <vector>

namespace gflow {

// What to draw, and a script for gnuplot that does.
struct Plot {
  std::string name, script;
  int width = 1000, height = 640;               // [px]
  std::vector<std::vector<std::string>> table;  // lines, the first one of headings
};
// A bar for each line of the table behind the first, made of its columns stacked; the first column
// names it, the first line the columns.
Plot bars(const std::string& name, const std::string& what,
          std::vector<std::vector<std::string>> table);

// Writes script and data beside each other in `folder` (made if need be) as NAME.gnuplot and
// NAME.tsv, and runs it there, for NAME.svg and NAME.png, where gnuplot is installed. Returns a
// sentence: where the plot is, or how to draw it.
std::string draw(const Plot& plot, const std::string& folder);

}  // namespace gflow
