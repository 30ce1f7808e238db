// SPDX-License-Identifier: Apache-2.0
// JSON of scene files: what is missing or of another kind is named with the place it was looked
// for.
#pragma once
#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <type_traits>
#include <vector>

namespace gflow {

using Json = nlohmann::json;

// The whole file. Error when it is missing, larger than 128 MB, of more than 800 000 values or
// 100 levels, or no JSON (NaN is none).
Json read_json(const std::string& path);

// A member of an object. Error when there is none; `where` names the object.
const Json& member(const Json& object, const std::string& key, const std::string& where);

// A finite number, or none where the object has no such member. Error when it is anything else.
std::optional<double> number(const Json& object, const std::string& key, const std::string& where);

// The same where it must be there.
double needed_number(const Json& object, const std::string& key, const std::string& where);

// A text of one line. Error when `value` is anything else; `what` names it.
std::string text(const Json& value, const std::string& what);

// A list of texts.
std::vector<std::string> texts(const Json& value, const std::string& what);

// A list of `count` finite numbers.
std::vector<double> numbers(const Json& value, size_t count, const std::string& what);

// rows x columns finite numbers, row by row.
Eigen::MatrixXd matrix(const Json& value, int rows, int columns, const std::string& what);

// The upper three rows [3, 4] of a pose; Error when a fourth is not 0 0 0 1 within 1e-5.
Eigen::MatrixXd pose_rows(const Json& value, const std::string& what);

// A number, text or truth value of an object; `otherwise` where it has none, or something else: for
// files of our own, which may be damaged.
template <class T>
T member_or(const Json& object, const char* key, T otherwise) {
  if (!object.is_object() || !object.contains(key)) return otherwise;
  const Json& value = object[key];
  const bool fits = std::is_same_v<T, bool>       ? value.is_boolean()
                    : std::is_integral_v<T>       ? value.is_number_integer()
                    : std::is_floating_point_v<T> ? value.is_number()
                                                  : value.is_string();
  return fits ? value.get<T>() : otherwise;
}

}  // namespace gflow
