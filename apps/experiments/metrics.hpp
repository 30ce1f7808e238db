// SPDX-License-Identifier: Apache-2.0
// Metrics of a run that a table can contain.
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
  int digits;                     // decimal places
  Better better;
  double scale = 1;  // factor on the value in results.json
  // Key of results.json that names the network which computed the metric; its value is null if no
  // network was given. nullptr: the metric needs no network.
  const char* model = nullptr;
  // Time steps to average if the path leads to a list of them; default: all.
  std::optional<std::pair<size_t, size_t>> steps = {};
};

// Parses FIRST-LAST, whole numbers with FIRST <= LAST; empty otherwise.
std::optional<std::pair<size_t, size_t>> step_range(const std::string& text);

// In table order: metrics of the test views, of the model, then costs, which differ between
// repeated runs.
const std::vector<Metric>& all_metrics();
std::vector<std::string> metric_names();
// NAME or, for metrics of views, tracks and motion, NAME@FIRST-LAST: the mean over these time steps
// of the video, from 0. Throws an Error for an unknown name.
Metric metric_named(const std::string& name);
// Whether two identical trainings produce the same value.
bool is_repeatable(const Metric& metric);

// NaN if the file has no value, or lacks some of the requested time steps.
double value_of(const Metric& metric, const nlohmann::json& results);
// Whether the value is missing because no network was given.
bool lacks_model(const Metric& metric, const nlohmann::json& results);

}  // namespace gflow::experiments
