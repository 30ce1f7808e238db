// SPDX-License-Identifier: Apache-2.0
// Limits on JSON from elsewhere, checked before parsing, and the parser's errors.
#pragma once
#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace gflow {

// Error that names `path` if there are more than 800 000 values or 100 levels (a value of a few
// bytes takes up to 80 of memory), a text longer than a megabyte, more than a million blanks in a
// row, or a zero byte.
void require_json_limits(const void* text, size_t size, const std::string& path);

// The same test, without an Error.
bool is_within_json_limits(const void* text, size_t size);

// The parsed text, keys in its order; a discarded value if it is not JSON or exceeds these limits.
nlohmann::ordered_json parse_json_within_limits(std::string_view text);

// The parser's reason without the library's own name for it, one line of at most 200 characters.
std::string reason_of(const nlohmann::json::exception& problem);

}  // namespace gflow
