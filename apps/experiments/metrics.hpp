// SPDX-License-Identifier: Apache-2.0
// The figures of a run that a table can have.
#pragma once
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace gflow::experiments {

enum class Better { higher, lower, neither };

struct Metric {
  std::string name;               // in experiment files
  std::string label;              // in tables, with its unit
  std::vector<const char*> path;  // in results.json
  int digits;                     // behind the point
  Better better;
  double scale = 1;  // of what the file has
  // Where results.json names the network that judged, null where none was given; nullptr: it needs
  // none.
  const char* model = nullptr;
  // Time steps of the video that count, where the path leads to a list of them; else all do.
  std::optional<std::pair<size_t, size_t>> steps = {};
};

// FIRST-LAST, whole numbers that do not fall; nothing where the text is none of that.
std::optional<std::pair<size_t, size_t>> step_range(const std::string& text);

// In the order of a table. Figures of the test views, then of the model, then what it cost: those
// differ from one time to the next.
const std::vector<Metric>& all_metrics();
std::vector<std::string> metric_names();
// NAME or, for figures of views, tracks and motions, NAME@FIRST-LAST: at those time steps of the
// video, from 0. Error when there is none of that name.
Metric metric_named(const std::string& name);
// Whether two trainings alike have the same.
bool is_repeatable(const Metric& metric);

// NaN where the file has none, or not all of the steps asked for.
double value_of(const Metric& metric, const nlohmann::json& results);
// Whether the file says that there is no value because no network was given.
bool lacks_model(const Metric& metric, const nlohmann::json& results);

}  // namespace gflow::experiments
