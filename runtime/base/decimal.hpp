// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <charconv>
#include <optional>
#include <string_view>
#include <system_error>

namespace gflow {

// The decimal number that the whole text is, as in TOML, JSON and PLY, with optional sign and
// exponent. nullopt for "inf", "nan" and hexadecimal numbers, which only some readers accept, and
// for values outside of double's range.
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
