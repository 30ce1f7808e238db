// SPDX-License-Identifier: Apache-2.0
// JSON on its way to a file or a terminal.
#pragma once
#include <nlohmann/json.hpp>
#include <string>

namespace gflow {

// One line, or with `indent` spaces a level. Names of files need not be UTF-8, and JSON must: what
// is none becomes U+FFFD.
template <class Json>
std::string json_text(const Json& json, int indent = -1) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace gflow
