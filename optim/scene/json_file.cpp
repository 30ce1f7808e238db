// SPDX-License-Identifier: Apache-2.0
#include "optim/scene/json_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string_view>

#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/modest_json.hpp"

namespace gflow {
namespace {

constexpr size_t largest_json = size_t{128} << 20;

bool is_finite_number(const Json& value) {
  return value.is_number() && std::isfinite(value.get<double>());
}

// Python writes NaN and infinite numbers as words that are not JSON. Here they become null, as
// other programs write them.
std::string with_null_for_words(const Bytes& bytes) {
  const std::string_view from(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  std::string to;
  bool quoted = false;
  for (size_t i = 0; i < from.size(); ++i) {
    const auto word_at = [&](std::string_view word) { return from.substr(i, word.size()) == word; };
    size_t length = 0;
    if (!quoted)
      for (const std::string_view word : {"NaN", "Infinity", "-Infinity"})
        if (word_at(word)) length = word.size();
    if (length > 0) {
      to += "null";
      i += length - 1;
      continue;
    }
    to += from[i];
    if (quoted && from[i] == '\\' && i + 1 < from.size())
      to += from[++i];
    else if (from[i] == '"')
      quoted = !quoted;
  }
  return to;
}

}  // namespace

Json read_json(const std::string& path) {
  const Bytes bytes = read_file(path, largest_json);
  require_json_limits(bytes.data(), bytes.size(), path);
  try {
    const Json json = Json::parse(bytes.begin(), bytes.end(), nullptr, false);
    return json.is_discarded() ? Json::parse(with_null_for_words(bytes)) : json;
  } catch (const Json::exception& cause) {
    throw Error(fmt::format("cannot read {}: it is not valid JSON ({})", path, reason_of(cause)));
  }
}

const Json& member(const Json& object, std::string_view key, const std::string& where) {
  if (!object.is_object() || !object.contains(key))
    throw Error(fmt::format("{} has no '{}'", where, key));
  return object[key];
}

std::optional<double> number(const Json& object, const std::string& key, const std::string& where) {
  if (!object.contains(key)) return std::nullopt;
  const Json& value = object[key];
  if (!is_finite_number(value))
    throw Error(fmt::format("'{}' of {} is not a finite number", key, where));
  return value.get<double>();
}

double needed_number(const Json& object, const std::string& key, const std::string& where) {
  member(object, key, where);
  return *number(object, key, where);
}

std::string text(const Json& value, const std::string& what) {
  if (!value.is_string()) throw Error(what + " is not a string");
  const auto words = value.get<std::string>();
  if (words.find_first_of(std::string("\n\r\0", 3)) != std::string::npos)
    throw Error(what + " is not a single-line string");
  return words;
}

std::vector<std::string> texts(const Json& value, const std::string& what) {
  if (!value.is_array()) throw Error(what + " is not a list");
  std::vector<std::string> list;
  for (const Json& one : value) list.push_back(text(one, "an entry of " + what));
  return list;
}

std::vector<double> numbers(const Json& value, size_t count, const std::string& what) {
  std::vector<double> list;
  if (value.is_array())
    for (const Json& one : value)
      if (is_finite_number(one)) list.push_back(one.get<double>());
  if (!value.is_array() || list.size() != count || value.size() != count)
    throw Error(fmt::format("{} is not a list of {} finite numbers", what, count));
  return list;
}

Eigen::MatrixXd matrix(const Json& value, int rows, int columns, const std::string& what) {
  const auto bad = [&] {
    throw Error(fmt::format("{} is not a {}x{} matrix of finite numbers", what, rows, columns));
  };
  if (!value.is_array() || int(value.size()) != rows) bad();
  Eigen::MatrixXd result(rows, columns);
  for (int r = 0; r < rows; ++r) {
    const Json& row = value[size_t(r)];
    if (!row.is_array() || int(row.size()) != columns) bad();
    for (int c = 0; c < columns; ++c) {
      if (!is_finite_number(row[size_t(c)])) bad();  // a NaN was written as null
      result(r, c) = row[size_t(c)].get<double>();
    }
  }
  return result;
}

Eigen::MatrixXd pose_rows(const Json& value, const std::string& what) {
  const bool has_last = value.is_array() && value.size() == 4;
  const Eigen::MatrixXd pose = matrix(value, has_last ? 4 : 3, 4, what);
  if (has_last && !(pose.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).isZero(1e-5))
    throw Error(fmt::format("the last row of {} is {} {} {} {}, expected 0 0 0 1", what, pose(3, 0),
                            pose(3, 1), pose(3, 2), pose(3, 3)));
  return pose.topRows(3);
}

}  // namespace gflow
