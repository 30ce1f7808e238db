// SPDX-License-Identifier: Apache-2.0
// The sub-commands of `gflow bench`, one file each.
#pragma once
#include <functional>
#include <string>

#include "apps/bench/report.hpp"
#include "apps/options.hpp"

namespace gflow::bench {

// What every bench takes.
struct BenchOptions {
  int repeats = 15;
  std::string json, compare;  // files, or empty
};
void add_common(CLI::App& bench, BenchOptions& options);

// Prints, writes and compares as asked for.
void deliver(const Report& report, const BenchOptions& options);

void add_raster(CLI::App& bench, const GlobalOptions& options);
void add_step(CLI::App& bench, const GlobalOptions& options);  // needs OpenCV

}  // namespace gflow::bench
