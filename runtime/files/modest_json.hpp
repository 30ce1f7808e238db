// SPDX-License-Identifier: Apache-2.0
// What is asked of JSON that others wrote before it is parsed, and said of what cannot be.
#pragma once
#include <cstddef>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

namespace gflow {

// Error that names `path` where there are more than 800 000 values or 100 levels, as a value of a
// few bytes takes up to 80 of memory, a text within is longer than a megabyte, there are more than
// a million blanks in a row, or a byte is zero.
void require_modest_json(const void* text, size_t size, const std::string& path);

// The same as a question.
bool is_modest_json(const void* text, size_t size);

// What it says, keys in the order of the text; a discarded value, which is of no type, where it is
// no JSON or more of it than above.
nlohmann::ordered_json parsed_if_modest(std::string_view text);

// The library's reason without its own name for it, one line of 200 letters at most.
std::string reason_of(const nlohmann::json::exception& problem);

}  // namespace gflow
