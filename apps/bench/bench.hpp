// SPDX-License-Identifier: Apache-2.0
// The sub-commands of `gflow bench`, one file each.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "apps/bench/report.hpp"
#include "apps/common/options.hpp"
#include "apps/common/plot.hpp"

namespace gflow::bench {

// What every bench takes.
struct BenchOptions {
  int repeats = 15;
  std::string json, compare, plots;  // files and a folder, or empty
  std::string markdown;              // a file, of benches that write a table
};
void add_common(CLI::App& bench, BenchOptions& options);

// Under an InterruptGuard: Interrupted where Ctrl-C was pressed, so that scratch folders go.
void stop_if_interrupted();

// "512x512" as width and height; Error names the option when it is no size.
std::pair<int, int> size_named(const std::string& option, const std::string& text);

// What was measured, and how to show it.
struct Result {
  Report report;
  std::vector<Plot> plots;
  std::string markdown = "";
};

// Error where a file that is to be written cannot be. Then measures, prints, writes, draws and
// compares as asked for: what was measured is shown whatever fails. Where something is worse than
// in --compare it measures once more, and ends the program with 3 where it is worse again.
void deliver(const BenchOptions& options, const std::function<Result()>& measure);

void add_raster(CLI::App& bench, const GlobalOptions& options);
void add_pareto(CLI::App& bench, const GlobalOptions& options);
void add_scaling(CLI::App& bench, const GlobalOptions& options);
// These need OpenCV.
void add_step(CLI::App& bench, const GlobalOptions& options);
void add_skip(CLI::App& bench, const GlobalOptions& options);

}  // namespace gflow::bench
