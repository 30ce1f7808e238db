// SPDX-License-Identifier: Apache-2.0
// The log of a training, as a report draws it.
#pragma once
#include <map>
#include <string>
#include <vector>

#include "apps/report/chart.hpp"

namespace gflow::report {

// A line of metrics.jsonl: its values by name, such as "loss"; without the step and those that are
// not numbers.
struct LogLine {
  double step = 0;
  std::map<std::string, double> values;
};
// The log of a run folder; empty if it has none.
std::vector<LogLine> read_log(const std::string& run_folder);

// A value over the steps; empty if no line has it.
Points curve_of(const std::vector<LogLine>& log, const std::string& name);

// Whether curves have enough points to be smoothed.
bool is_smoothed(const std::vector<LogLine>& log);

// Curves of a training: loss terms, PSNR, flow error, Gaussians. HTML; empty without a log.
std::string training_charts(const std::vector<LogLine>& log);

}  // namespace gflow::report
