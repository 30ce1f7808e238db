// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <toml++/toml.h>

#include <string>
#include <string_view>

namespace gflow {

// Settings from a text; `path` is what Errors and the table's places name. Error when it has more
// than 5000 dots; toml::parse_error when it is no TOML.
toml::table parse_toml(std::string_view text, const std::string& path);

// A file of them, at most 1 MB. Error also when it cannot be read.
toml::table read_toml(const std::string& path);

}  // namespace gflow
