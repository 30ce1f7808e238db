// SPDX-License-Identifier: Apache-2.0
// What a bench found, as a table on the terminal, as JSON, and beside an earlier one.
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "apps/bench/measure.hpp"
#include "apps/bench/peak.hpp"

namespace gflow::bench {

using Json = nlohmann::ordered_json;

// One figure with its unit in its name, e.g. "wall [ms]". One that was measured once has no spread.
struct Figure {
  std::string name;
  Spread value;
  bool spread = true;
  bool error = false;  // that may not grow either, as times may not
};
inline Figure single(std::string name, double value) {
  return {std::move(name), {value, value, value}, false};
}

inline Figure error(std::string name, double value) {
  return {std::move(name), {value, value, value}, false, true};
}

// What was measured, under a name that no other row of the report has.
struct Row {
  std::string name;
  std::vector<Figure> figures;
};

class Report {
 public:
  // `bench` is the sub-command; facts say what was run, e.g. {"pixels", "512x512"}.
  Report(std::string bench, const Queue& queue, const Peak& peak, Json facts);
  void add(Row row) { rows_.push_back(std::move(row)); }
  // A sentence, without a full stop, that stands below the tables.
  void note(std::string text) { notes_.push_back(std::move(text)); }

  // Rows with the same figures side by side in one table, medians, and quartiles where they differ.
  void print() const;
  Json json() const;
  // The ratios of medians, new by old, of every time with a spread ("[ms]", "[s]") and of every
  // error that both have, and which rows only one of them has. What has grown by more than a tenth
  // is marked, times only where the quartiles do not overlap; how many is returned. Error when OLD
  // is no report of this bench.
  int compare(const std::string& old_path) const;

 private:
  Json head_, facts_;  // facts_ are in head_, too
  std::vector<Row> rows_;
  std::vector<std::string> notes_;
};

}  // namespace gflow::bench
