// SPDX-License-Identifier: Apache-2.0
// An earlier report of `gflow bench`, read from a file for --compare.
#pragma once
#include <nlohmann/json.hpp>
#include <string>

#include "apps/bench/measure/samples.hpp"

namespace gflow::bench {

using Json = nlohmann::ordered_json;

// Error if the file is not a report of this bench, or is larger than 16 MB.
Json read_report(const std::string& path, const std::string& bench);

// Equality regardless of the order of keys.
bool same_json(const Json& a, const Json& b);

// A string of the report; "" if the key is missing.
std::string text_of(const Json& report, const char* key);

// A value of the report's rows; NaN if it is missing.
Spread value_in(const Json& rows, const std::string& row, const std::string& name);

}  // namespace gflow::bench
