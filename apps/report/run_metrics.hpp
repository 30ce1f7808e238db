// SPDX-License-Identifier: Apache-2.0
// The sections of a run's report that show metrics.
#pragma once
#include <string>
#include <vector>

#include "apps/report/run_report.hpp"

namespace gflow::report {

// How a metric is shown.
struct ShownMetric {
  double ViewMetrics::*value;
  const char *name, *unit;
  int digits;
  double scale;
  bool higher_is_better;
  const char* meaning;
};

// All metrics that a view may have, PSNR first.
const std::vector<ShownMetric>& shown_metrics();

// "28.95 dB"; "–" if not finite.
std::string with_unit(const ShownMetric& metric, double value);

// "train" -> "training".
std::string split_in_words(const std::string& split);

// The view with the worst value, or the best; null if none has one.
const ViewMetrics* extreme(const std::vector<ViewMetrics>& views, const ShownMetric& metric,
                           bool worst);

// HTML; sections are empty without values.
std::string tiles(const RunReport& report);
std::string time_section(const RunReport& report);  // over the time steps
std::string metrics_section(const RunReport& report);
std::string cameras_section(const RunReport& report);

}  // namespace gflow::report
