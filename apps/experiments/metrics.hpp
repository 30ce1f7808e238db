// SPDX-License-Identifier: Apache-2.0
// The figures of a run that a table can have.
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace gflow::experiments {

enum class Better { higher, lower, neither };

struct Metric {
  const char* name;               // in experiment files
  const char* label;              // in tables, with its unit
  std::vector<const char*> path;  // in results.json
  int digits;                     // behind the point
  Better better;
  double scale = 1;  // of what the file has
  // Where results.json names the network that judged, null where none was given; nullptr: it needs
  // none.
  const char* model = nullptr;
};

// In the order of a table. Figures of the test views, then of the model, then what it cost: those
// differ from one time to the next.
const std::vector<Metric>& all_metrics();
std::vector<std::string> metric_names();
const Metric& metric_named(const std::string& name);
// Whether two trainings alike have the same.
bool is_repeatable(const Metric& metric);

// NaN where the file has none.
double value_of(const Metric& metric, const nlohmann::json& results);
// Whether the file says that there is no value because no network was given.
bool lacks_model(const Metric& metric, const nlohmann::json& results);

}  // namespace gflow::experiments
