// SPDX-License-Identifier: Apache-2.0
// An earlier report of `gflow bench`, as --compare takes it from a file.
#pragma once
#include <nlohmann/json.hpp>
#include <string>

#include "apps/bench/samples.hpp"

namespace gflow::bench {

using Json = nlohmann::ordered_json;

// Error where a file is no report of this bench, or of more than 16 MB.
Json read_report(const std::string& path, const std::string& bench);

// Whether it was measured with the same, in whatever order the keys are.
bool same_json(const Json& a, const Json& b);

// A text of it; "" where it has none of that key.
std::string text_of(const Json& report, const char* key);

// A figure of its rows; NaN where it has none.
Spread figure_of(const Json& rows, const std::string& row, const std::string& name);

}  // namespace gflow::bench
