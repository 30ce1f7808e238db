// SPDX-License-Identifier: Apache-2.0
#include "apps/bench/measure/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "runtime/base/output.hpp"

namespace gflow::bench {
namespace {

constexpr double kGrown = 1.1;   // a larger ratio counts as worse
constexpr double kFallen = 0.2;  // [dB]; a larger loss of quality counts as worse

// Four significant digits where readable.
std::string digits(double x) {
  if (std::isnan(x)) return "-";
  const double size = std::fabs(x);
  if (size == 0) return "0";
  if (size >= 1e7 || size < 1e-3) return fmt::format("{:.2e}", x);
  return fmt::format("{:.{}f}", x, std::clamp(3 - int(std::floor(std::log10(size))), 0, 4));
}

std::string shown(const Measurement& m) {
  if (!m.spread || m.value.low == m.value.high) return digits(m.value.median);
  return fmt::format("{} ({} - {})", digits(m.value.median), digits(m.value.low),
                     digits(m.value.high));
}

bool same_measurements(const Row& a, const Row& b) {
  return std::equal(a.measurements.begin(), a.measurements.end(), b.measurements.begin(),
                    b.measurements.end(),
                    [](const Measurement& x, const Measurement& y) { return x.name == y.name; });
}

void print_table(const std::vector<std::vector<std::string>>& lines) {
  std::vector<size_t> widths;
  for (const auto& line : lines)
    for (size_t k = 0; k < line.size(); ++k) {
      if (k == widths.size()) widths.push_back(0);
      widths[k] = std::max(widths[k], line[k].size());
    }
  for (const auto& line : lines) {
    print_result("  {:<{}}", line[0], widths[0]);
    for (size_t k = 1; k < line.size(); ++k) print_result("  {:>{}}", line[k], widths[k]);
    print_result("\n");
  }
}

// Whether a value is a time to compare. Values that follow from another one, such as ns per pair or
// a time without a spread, are not.
bool is_time(const Measurement& m) {
  return m.spread &&
         (m.name.find("[ms]") != std::string::npos || m.name.find("[s]") != std::string::npos);
}

// Whether a time is evaluated: in a row with CPU time only that one.
bool is_evaluated(const Row& row, const Measurement& m) {
  const auto is_cpu = [](const Measurement& x) {
    return is_time(x) && x.name.rfind("CPU", 0) == 0;
  };
  return !row.brief &&
         (is_cpu(m) || std::none_of(row.measurements.begin(), row.measurements.end(), is_cpu));
}

}  // namespace

Report::Report(std::string bench, Queue& queue, Json facts, const std::string& old)
    : facts_(std::move(facts)), old_path_(old) {
  facts_["lanes"] = queue.lanes;
  if (!old.empty()) {
    old_ = read_report(old, bench);
    for (const auto& [key, value] : facts_.items())
      if (key != "repeats" && old_.contains(key) && !same_json(old_[key], value))
        throw Error(fmt::format("comparing with {}: that was measured with {} {}, this with {}",
                                old, key, old_[key].dump(), value.dump()));
  }
  peak_ = measure_peak(queue);
  head_ = {{"bench", std::move(bench)},
           {"version", GFLOW_VERSION},
           {"device", queue.info.full_name()},
           {"driver", queue.info.driver},
           {"compute_units", queue.info.compute_units},
           {"lanes", queue.lanes},
           {"peak_gflops", peak_.gflops},
           {"peak_copy_gbs", peak_.copy_gbs}};
  for (const auto& [key, value] : facts_.items()) head_[key] = value;
}

void Report::measure_peak_again(Queue& queue) {
  const Peak now = measure_peak(queue);
  head_["peak_gflops_after"] = now.gflops;
  head_["peak_copy_gbs_after"] = now.copy_gbs;
  const auto apart = [](double a, double b) { return std::max(a, b) > 1.2 * std::min(a, b); };
  if (apart(peak_.gflops, now.gflops) || apart(peak_.copy_gbs, now.copy_gbs))
    note(
        fmt::format("the peaks were {} GFLOP/s and {} GB/s afterwards: the machine has done other "
                    "things meanwhile, shares of them are not to be trusted",
                    digits(now.gflops), digits(now.copy_gbs)));
}

void Report::print() const {
  print_result("{}, {} lanes, peak {} GFLOP/s, copy {} GB/s\n", head_["device"].get<std::string>(),
               head_["lanes"].get<int>(), digits(head_["peak_gflops"]),
               digits(head_["peak_copy_gbs"]));
  for (size_t first = 0; first < rows_.size();) {
    std::vector<std::vector<std::string>> lines{{""}};
    for (const Measurement& m : rows_[first].measurements) lines[0].push_back(m.name);
    size_t k = first;
    for (; k < rows_.size() && same_measurements(rows_[k], rows_[first]); ++k) {
      lines.push_back({rows_[k].name});
      for (const Measurement& m : rows_[k].measurements) lines.back().push_back(shown(m));
    }
    print_table(lines);
    first = k;
  }
  for (const std::string& note : notes_) print_result("{}\n", note);
}

Json Report::json() const {
  Json all = head_;
  for (const Row& row : rows_) {
    Json values = Json::object();
    for (const Measurement& m : row.measurements)
      values[m.name] =
          m.spread ? Json{{"median", m.value.median}, {"low", m.value.low}, {"high", m.value.high}}
                   : Json(m.value.median);
    all["rows"][row.name] = values;
  }
  all["notes"] = notes_;  // also if empty, so that reports have a fixed set of keys
  return all;
}

std::vector<std::string> Report::compare() const {
  const Json& rows = old_["rows"];
  if (text_of(old_, "device") != head_["device"])
    print_result("{} was measured on another device, {}\n", old_path_, text_of(old_, "device"));
  std::vector<std::vector<std::string>> lines{
      {"lower quartiles; errors and dB in the middle", "before", "now", "ratio"}};
  std::vector<std::string> only_here, only_there, worse;
  for (const Row& row : rows_) {
    if (!rows.contains(row.name)) only_here.push_back(row.name);
    for (const Measurement& m : row.measurements) {
      const Spread before = value_in(rows, row.name, m.name);
      const std::string name = row.name + ", " + m.name;
      if (m.quality && std::isfinite(before.median)) {
        const double gain = m.value.median - before.median;
        const bool fell = gain < -kFallen && m.value.high < before.low;
        if (fell) worse.push_back(name);
        lines.push_back({name, digits(before.median), digits(m.value.median),
                         fmt::format("{:+.2f} dB{}", gain, fell ? " worse" : "")});
      }
      if (!(is_time(m) || m.error) || !(before.low > 0)) continue;
      const auto shown = [&](const Spread& s) { return m.error ? s.median : s.low; };
      const double ratio = shown(m.value) / shown(before);
      const char* said = "";
      if (ratio > kGrown) {
        if (!m.error && !is_evaluated(row, m))
          said = " not evaluated";
        else if (!(m.value.low > before.high))
          said = m.error ? " within the seeds" : " within the quartiles";
        else
          said = m.error ? " less exact" : " slower", worse.push_back(name);
      }
      lines.push_back({name, digits(shown(before)), digits(shown(m.value)),
                       fmt::format("{:.3f}{}", ratio, said)});
    }
  }
  for (const auto& entry : rows.items())
    if (std::none_of(rows_.begin(), rows_.end(),
                     [&](const Row& row) { return row.name == entry.key(); }))
      only_there.push_back(entry.key());
  if (lines.size() == 1)
    throw Error(
        fmt::format("comparing with {}: it has no time of a row that is here, measure the "
                    "same again",
                    old_path_));
  print_table(lines);
  if (!only_here.empty()) print_result("only here: {}\n", fmt::join(only_here, ", "));
  if (!only_there.empty()) print_result("only in {}: {}\n", old_path_, fmt::join(only_there, ", "));
  return worse;
}

}  // namespace gflow::bench
