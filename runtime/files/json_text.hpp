// SPDX-License-Identifier: Apache-2.0
// JSON as text for a file or a terminal.
#pragma once
#include <nlohmann/json.hpp>
#include <string>

namespace gflow {

// One line, or `indent` spaces per level. Invalid UTF-8, as in some file names, becomes U+FFFD.
template <class Json>
std::string json_text(const Json& json, int indent = -1) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace gflow
