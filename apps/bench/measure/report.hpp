// SPDX-License-Identifier: Apache-2.0
// Results of a bench: as a table on the terminal, as JSON, and compared with an earlier report.
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "apps/bench/measure/measure.hpp"
#include "apps/bench/measure/old_report.hpp"
#include "apps/bench/peak.hpp"

namespace gflow::bench {

// A value with its unit in the name, e.g. "wall [ms]". Values measured once have no spread.
struct Measurement {
  std::string name;
  Spread value;
  bool spread = true;
  bool error = false;    // must not grow, as times
  bool quality = false;  // [dB]; must not fall
};
inline Measurement single(std::string name, double value) {
  return {std::move(name), {value, value, value}, false};
}

inline Measurement error(std::string name, double value) {
  return {std::move(name), {value, value, value}, false, true};
}

// A row of values; its name is unique in the report.
struct Row {
  std::string name;
  std::vector<Measurement> measurements;
  bool brief = false;  // too small a part of the whole to evaluate its time
};
// Whether a part takes less than 5 % of the whole's time.
inline bool is_brief(const Samples& part, const Samples& whole) {
  return ratio_of(part, whole).median < 0.05;
}

class Report {
 public:
  // `bench` is the sub-command; `facts` are the conditions, e.g. {"pixels", "512x512"}. Measures
  // the peaks. Error, before anything else is measured, if the earlier report `old` (a path or "")
  // is of another bench or has other facts.
  Report(std::string bench, Queue& queue, Json facts, const std::string& old);
  const Peak& peak() const { return peak_; }
  // Call after the measurements: adds a note if the peaks have changed.
  void measure_peak_again(Queue& queue);
  void add(Row row) { rows_.push_back(std::move(row)); }
  // Adds a sentence, without full stop, below the tables.
  void note(std::string text) { notes_.push_back(std::move(text)); }

  // Prints rows with the same values as one table: medians, and quartiles if they differ.
  void print() const;
  Json json() const;
  // Prints ratios to the old report for times with a spread ("[ms]", "[s]") and for errors,
  // differences of qualities, and rows that only one report has. Returns the names of what is
  // worse: an error that grew by more than a tenth, a quality that fell by more than 0.2 dB, or a
  // time whose lower quartile grew by more than a tenth (disturbances only add time), each only if
  // the spreads do not overlap. In rows with CPU time only that is evaluated, because other
  // programs affect the other times; brief rows are not evaluated.
  std::vector<std::string> compare() const;

 private:
  Json head_, facts_;  // facts_ are also in head_
  Peak peak_;
  std::string old_path_;
  Json old_;
  std::vector<Row> rows_;
  std::vector<std::string> notes_;
};

}  // namespace gflow::bench
