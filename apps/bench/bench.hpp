// SPDX-License-Identifier: Apache-2.0
// The sub-commands of `gflow bench`, one file each.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "apps/bench/measure/report.hpp"
#include "apps/common/options.hpp"
#include "apps/common/plot.hpp"

namespace gflow::bench {

// Options common to all benches.
struct BenchOptions {
  int repeats = 15;
  std::string json, compare, plots;  // files and a folder, or empty
  std::string markdown;              // file, for benches that write a table
};
void add_common(CLI::App& bench, BenchOptions& options);

// Call under an InterruptGuard. Throws Interrupted after Ctrl-C, so that scratch folders are
// removed.
void stop_if_interrupted();

// Width and height of "512x512". Error that names the option if the text is not a size.
std::pair<int, int> size_named(const std::string& option, const std::string& text);

// The measurements of a bench and their presentation.
struct Result {
  Report report;
  std::vector<Plot> plots;
  std::string markdown = "";
};

// Checks output paths, then measures, prints, writes, plots and compares as requested; the report
// is printed even if a later part fails. If something is worse than in --compare, measures once
// more, and exits with code 3 if it is worse again.
void deliver(const BenchOptions& options, const std::function<Result()>& measure);

void add_raster(CLI::App& bench, const GlobalOptions& options);
void add_pareto(CLI::App& bench, const GlobalOptions& options);
void add_scaling(CLI::App& bench, const GlobalOptions& options);
// These need OpenCV.
void add_step(CLI::App& bench, const GlobalOptions& options);
void add_skip(CLI::App& bench, const GlobalOptions& options);

}  // namespace gflow::bench
