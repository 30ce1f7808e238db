// SPDX-License-Identifier: Apache-2.0
#include "apps/bench/measure/old_report.hpp"

#include <fmt/format.h>

#include <cmath>
#include <string_view>

#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/modest_json.hpp"

namespace gflow::bench {
namespace {

constexpr size_t largest_report = size_t{16} << 20;

}  // namespace

Json read_report(const std::string& path, const std::string& bench) {
  const Bytes bytes = read_file(path, largest_report);
  Json report = parse_json_within_limits(
      std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
  if (!report.is_object() || report.value("bench", Json()) != bench || !report.contains("rows") ||
      !report["rows"].is_object())
    throw Error(fmt::format("{}: it is no report of `gflow bench {}`", path, bench));
  return report;
}

bool same_json(const Json& a, const Json& b) {
  return nlohmann::json::parse(a.dump()) == nlohmann::json::parse(b.dump());
}

std::string text_of(const Json& report, const char* key) {
  const Json value = report.value(key, Json());
  return value.is_string() ? value.get<std::string>() : std::string();
}

Spread value_in(const Json& rows, const std::string& row, const std::string& name) {
  const double nan = std::nan("");
  if (!rows.contains(row) || !rows[row].is_object() || !rows[row].contains(name))
    return {nan, nan, nan};
  const Json& value = rows[row][name];
  const auto part = [&](const char* key) {
    if (value.is_number()) return value.get<double>();
    return value.is_object() && value.contains(key) && value[key].is_number()
               ? value[key].get<double>()
               : nan;
  };
  return {part("median"), part("low"), part("high")};
}

}  // namespace gflow::bench
