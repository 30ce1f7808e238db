// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <toml++/toml.h>

#include <string>
#include <string_view>

#include "optim/io/atomic_file.hpp"

namespace gflow {

// A file of settings, at most 4 MB. Error when it cannot be read; toml::parse_error when it is no
// TOML.
inline toml::table read_toml(const std::string& path) {
  constexpr size_t largest = size_t{4} << 20;  // all settings take 40 kB with their comments
  const Bytes bytes = read_file(path, largest);
  return toml::parse(std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()),
                     path);
}

}  // namespace gflow
