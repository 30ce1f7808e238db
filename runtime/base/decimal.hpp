// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <charconv>
#include <optional>
#include <string_view>
#include <system_error>

namespace gflow {

// The number that a text is, and nothing else: decimal, as TOML, JSON and PLY have it, with a sign
// or an exponent or neither. None for hexadecimal ones, which only some readers would take, for
// "inf" and "nan", and where no double is as large or as small.
inline std::optional<double> decimal_number(std::string_view text) {
  if (text.size() > 1 && text[0] == '+' && text[1] != '-') text.remove_prefix(1);
  if (text.find_first_of("0123456789") == text.npos) return std::nullopt;
  double value = 0;
  const char* const end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, value);
  if (result.ec != std::errc() || result.ptr != end) return std::nullopt;
  return value;
}

}  // namespace gflow
