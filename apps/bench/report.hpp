// SPDX-License-Identifier: Apache-2.0
// What a bench found, as a table on the terminal, as JSON, and beside an earlier one.
#pragma once
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "apps/bench/measure.hpp"
#include "apps/bench/old_report.hpp"
#include "apps/bench/peak.hpp"

namespace gflow::bench {

// One figure with its unit in its name, e.g. "wall [ms]". One that was measured once has no spread.
struct Figure {
  std::string name;
  Spread value;
  bool spread = true;
  bool error = false;    // that may not grow either, as times may not
  bool quality = false;  // [dB] that may not fall
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
  bool brief = false;  // too small a part of the whole for its time to be judged
};
// Whether the times of a part are less than 5 % of the whole's.
inline bool is_brief(const Samples& part, const Samples& whole) {
  return ratio_of(part, whole).median < 0.05;
}

class Report {
 public:
  // `bench` is the sub-command; facts say what is run, e.g. {"pixels", "512x512"}. Measures the
  // peaks. Error where `old`, the path of an earlier report or "", is none of this bench, or of
  // other facts: before anything else is measured.
  Report(std::string bench, Queue& queue, Json facts, const std::string& old);
  const Peak& peak() const { return peak_; }
  // Behind what was measured: a note tells where the peaks are others by then.
  void measure_peak_again(Queue& queue);
  void add(Row row) { rows_.push_back(std::move(row)); }
  // A sentence, without a full stop, that stands below the tables.
  void note(std::string text) { notes_.push_back(std::move(text)); }

  // Rows with the same figures side by side in one table, medians, and quartiles where they differ.
  void print() const;
  Json json() const;
  // Prints the ratios to the old report, of every time with a spread ("[ms]", "[s]") and of every
  // error that both have, the differences of qualities, and which rows only one of them has.
  // Returns the names of what is worse: an error that has grown by more than a tenth, a quality
  // that has fallen by more than .2 dB, a time whose lower quartile has grown by a tenth (what
  // disturbs a measurement only adds to it); in each case only where the spreads do not overlap
  // either. Of a row with CPU time only that is judged, as other programs take part of the other
  // times; of a brief row nothing.
  std::vector<std::string> compare() const;

 private:
  Json head_, facts_;  // facts_ are in head_, too
  Peak peak_;
  std::string old_path_;
  Json old_;
  std::vector<Row> rows_;
  std::vector<std::string> notes_;
};

}  // namespace gflow::bench
