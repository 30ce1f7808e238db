// SPDX-License-Identifier: Apache-2.0
// How a room declares its settings: a plain struct with the default at each member, and a template
// fields(self, field) that calls field(key, member, help[, range]) for each of them in the order of
// the file. Reading, --set, printing and checking all go through that list.
#pragma once
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "runtime/base/error.hpp"

namespace gflow {

// What a setting means, in words.
struct Help {
  const char* text;
  bool advanced = false;  // internal: `gflow settings` shows it with --all only

  Help(const char* text) : text(text) {}
  Help(const char* text, bool advanced) : text(text), advanced(advanced) {}
};
inline Help advanced(const char* text) { return {text, true}; }

// The values a number may take. An empty `among` means every value between min and max. Bounds are
// floats because the settings are: 0.99 as a float exceeds 0.99 as a double.
struct Allowed {
  float min = std::numeric_limits<float>::lowest();
  float max = std::numeric_limits<float>::max();
  bool above_min = false;  // min itself is refused
  std::vector<float> among = {};
  bool or_zero = false;  // 0 as well, which leaves it to gflow

  bool contains(double value) const;  // false for NaN and infinities
  bool contains(int64_t value) const;
  std::string text() const;  // "0 to 1", "at least 1", "above 0", "one of 1, 2, 4, 8"
};
inline Allowed between(float min, float max) { return {min, max}; }
inline Allowed zero_or_between(float min, float max) {
  Allowed range{min, max};
  range.or_zero = true;
  return range;
}
inline Allowed at_least(float min) { return {min}; }
inline Allowed above(float min) {
  Allowed range{min};
  range.above_min = true;
  return range;
}
inline Allowed above_up_to(float min, float max) {
  Allowed range{min, max};
  range.above_min = true;
  return range;
}
Allowed one_of(std::vector<float> values);

// Choices are enums that count from 0, with names_of(Enum) for the words users write.
template <class Enum>
constexpr const char* name_of(Enum value) {
  return names_of(value)[static_cast<size_t>(value)];
}

// The value of that name; Error that lists the choices.
template <class Enum>
Enum value_named(const std::string& name) {
  const auto names = names_of(Enum{});
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end())
    throw Error(fmt::format("unknown value '{}'; choose one of {}", name, fmt::join(names, ", ")));
  return Enum(found - names.begin());
}

}  // namespace gflow
