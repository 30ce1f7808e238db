// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <toml++/toml.h>

#include <string>
#include <string_view>

namespace gflow {

// Parses settings; `path` is named in Errors and in the table's source positions. Error if there
// are more than 5000 dots; toml::parse_error if it is not TOML.
toml::table parse_toml(std::string_view text, const std::string& path);

// "NAME, line 3, column 7: the value is missing or malformed; text needs quotes": the place and the
// problem of a text called `name`, instead of the parser's own words.
std::string toml_problem(const std::string& name, const toml::parse_error& problem);

// Reads and parses a file of settings, at most 1 MiB. Error also if it cannot be read.
toml::table read_toml(const std::string& path);

}  // namespace gflow
