// SPDX-License-Identifier: Apache-2.0
// JSON of scene files. Errors name the place of a value that is missing or of another type.
#pragma once
#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace gflow {

using Json = nlohmann::json;

// Parses a whole file. Error if it is missing, larger than 128 MB, has more than 800 000 values or
// 100 levels, or is not JSON (NaN is not).
Json read_json(const std::string& path);

// A member of an object. Error if it is missing; `where` names the object.
const Json& member(const Json& object, std::string_view key, const std::string& where);

// A finite number; nullopt if the object has no such member. Error if it is anything else.
std::optional<double> number(const Json& object, const std::string& key, const std::string& where);

// A finite number. Error if it is missing or anything else.
double needed_number(const Json& object, const std::string& key, const std::string& where);

// A string of one line. Error if `value` is anything else; `what` names it.
std::string text(const Json& value, const std::string& what);

// A list of strings, each as text().
std::vector<std::string> texts(const Json& value, const std::string& what);

// A list of `count` finite numbers.
std::vector<double> numbers(const Json& value, size_t count, const std::string& what);

// rows x columns finite numbers as a list of rows.
Eigen::MatrixXd matrix(const Json& value, int rows, int columns, const std::string& what);

// The upper three rows of a pose, [3, 4]. Error if there is a fourth row that is not 0 0 0 1 within
// 1e-5.
Eigen::MatrixXd pose_rows(const Json& value, const std::string& what);

// A number, string or boolean of an object; `otherwise` if it is missing or of another type. For
// files that gflow wrote, which may be damaged.
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
