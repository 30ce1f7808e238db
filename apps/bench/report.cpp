// SPDX-License-Identifier: Apache-2.0
#include "apps/bench/report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "optim/io/atomic_file.hpp"

namespace gflow::bench {
namespace {

constexpr double kGrown = 1.1;  // a ratio of medians above it is worth a look

// Four digits, as long as that is readable.
std::string digits(double x) {
  if (std::isnan(x)) return "-";
  const double size = std::fabs(x);
  if (size == 0) return "0";
  if (size >= 1e7 || size < 1e-3) return fmt::format("{:.2e}", x);
  return fmt::format("{:.{}f}", x, std::clamp(3 - int(std::floor(std::log10(size))), 0, 4));
}

std::string shown(const Figure& f) {
  if (!f.spread || f.value.low == f.value.high) return digits(f.value.median);
  return fmt::format("{} ({} - {})", digits(f.value.median), digits(f.value.low),
                     digits(f.value.high));
}

bool same_figures(const Row& a, const Row& b) {
  return std::equal(a.figures.begin(), a.figures.end(), b.figures.begin(), b.figures.end(),
                    [](const Figure& x, const Figure& y) { return x.name == y.name; });
}

void print_table(const std::vector<std::vector<std::string>>& lines) {
  std::vector<size_t> widths;
  for (const auto& line : lines)
    for (size_t k = 0; k < line.size(); ++k) {
      if (k == widths.size()) widths.push_back(0);
      widths[k] = std::max(widths[k], line[k].size());
    }
  for (const auto& line : lines) {
    fmt::print("  {:<{}}", line[0], widths[0]);
    for (size_t k = 1; k < line.size(); ++k) fmt::print("  {:>{}}", line[k], widths[k]);
    fmt::print("\n");
  }
}

// Figures that follow from another one, such as [ns] a pair or a time without a spread, need not be
// compared as well.
bool is_time(const Figure& f) {
  return f.spread &&
         (f.name.find("[ms]") != std::string::npos || f.name.find("[s]") != std::string::npos);
}

// A figure of a report that was read; NaN where it has none.
Spread figure_of(const Json& rows, const std::string& row, const std::string& name) {
  const double nan = std::nan("");
  if (!rows.contains(row) || !rows[row].is_object() || !rows[row].contains(name))
    return {nan, nan, nan};
  const Json& figure = rows[row][name];
  const auto part = [&](const char* key) {
    if (figure.is_number()) return figure.get<double>();
    return figure.is_object() && figure.contains(key) && figure[key].is_number()
               ? figure[key].get<double>()
               : nan;
  };
  return {part("median"), part("low"), part("high")};
}

}  // namespace

Report::Report(std::string bench, const Queue& queue, const Peak& peak, Json facts)
    : head_{{"bench", std::move(bench)},
            {"version", GFLOW_VERSION},
            {"device", queue.info.full_name()},
            {"driver", queue.info.driver},
            {"compute_units", queue.info.compute_units},
            {"lanes", queue.lanes},
            {"peak_gflops", peak.gflops},
            {"peak_copy_gbs", peak.copy_gbs}},
      facts_(std::move(facts)) {
  facts_["lanes"] = queue.lanes;
  for (const auto& [key, value] : facts_.items()) head_[key] = value;
}

void Report::print() const {
  fmt::print("{}, {} lanes, peak {} GFLOP/s, copy {} GB/s\n", head_["device"].get<std::string>(),
             head_["lanes"].get<int>(), digits(head_["peak_gflops"]),
             digits(head_["peak_copy_gbs"]));
  for (size_t first = 0; first < rows_.size();) {
    std::vector<std::vector<std::string>> lines{{""}};
    for (const Figure& f : rows_[first].figures) lines[0].push_back(f.name);
    size_t k = first;
    for (; k < rows_.size() && same_figures(rows_[k], rows_[first]); ++k) {
      lines.push_back({rows_[k].name});
      for (const Figure& f : rows_[k].figures) lines.back().push_back(shown(f));
    }
    print_table(lines);
    first = k;
  }
  for (const std::string& note : notes_) fmt::print("{}\n", note);
}

Json Report::json() const {
  Json all = head_;
  for (const Row& row : rows_) {
    Json figures = Json::object();
    for (const Figure& f : row.figures)
      figures[f.name] =
          f.spread ? Json{{"median", f.value.median}, {"low", f.value.low}, {"high", f.value.high}}
                   : Json(f.value.median);
    all["rows"][row.name] = figures;
  }
  if (!notes_.empty()) all["notes"] = notes_;
  return all;
}

int Report::compare(const std::string& old_path) const {
  const Bytes bytes = read_file(old_path);
  const Json old = Json::parse(bytes.begin(), bytes.end(), nullptr, false);
  const auto text = [&](const char* key) {
    return old.is_object() && old.contains(key) && old[key].is_string()
               ? old[key].get<std::string>()
               : std::string();
  };
  if (text("bench") != head_["bench"] || !old.contains("rows") || !old["rows"].is_object())
    throw Error(fmt::format("comparing with {}: it is no report of `gflow bench {}`", old_path,
                            head_["bench"].get<std::string>()));
  if (text("device") != head_["device"])
    fmt::print("{} was measured on another device, {}\n", old_path, text("device"));
  for (const auto& [key, value] : facts_.items())
    if (key != "repeats" && old.contains(key) && old[key] != value)
      throw Error(fmt::format("comparing with {}: that was measured with {} {}, this with {}",
                              old_path, key, old[key].dump(), value.dump()));
  std::vector<std::vector<std::string>> lines{{"", "before", "now", "ratio"}};
  std::vector<std::string> only_here, only_there;
  int grown = 0;
  for (const Row& row : rows_) {
    if (!old["rows"].contains(row.name)) only_here.push_back(row.name);
    for (const Figure& f : row.figures) {
      const Spread before = figure_of(old["rows"], row.name, f.name);
      const double ratio = f.value.median / before.median;
      if (!(is_time(f) || f.error) || !(before.median > 0)) continue;
      const bool larger = ratio > kGrown, apart = f.error || f.value.low > before.high;
      grown += larger && apart;
      lines.push_back({row.name + ", " + f.name, digits(before.median), digits(f.value.median),
                       fmt::format("{:.3f}{}", ratio,
                                   !larger   ? ""
                                   : !apart  ? " within the quartiles"
                                   : f.error ? " less exact"
                                             : " slower")});
    }
  }
  for (const auto& [name, figures] : old["rows"].items())
    if (std::none_of(rows_.begin(), rows_.end(), [&](const Row& row) { return row.name == name; }))
      only_there.push_back(name);
  if (lines.size() == 1)
    throw Error(
        fmt::format("comparing with {}: it has no time of a row that is here, measure the "
                    "same again",
                    old_path));
  print_table(lines);
  if (!only_here.empty()) fmt::print("only here: {}\n", fmt::join(only_here, ", "));
  if (!only_there.empty()) fmt::print("only in {}: {}\n", old_path, fmt::join(only_there, ", "));
  return grown;
}

}  // namespace gflow::bench
