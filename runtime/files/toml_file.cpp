// SPDX-License-Identifier: Apache-2.0
#include "runtime/files/toml_file.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {
namespace {

// toml++ 3.3 limits the nesting of values, but makes a table for each part of a key a.b.c and
// destroys tables recursively: tens of thousands of parts overflow the stack. No file of settings
// has as many dots, including those in numbers and words.
void require_few_dots(std::string_view text, const std::string& path) {
  constexpr long most = 5000;
  if (const long dots = std::count(text.begin(), text.end(), '.'); dots > most)
    throw Error(fmt::format("cannot read {}: it has {} dots; at most {} are allowed in settings",
                            path, dots, most));
}

}  // namespace

toml::table parse_toml(std::string_view text, const std::string& path) {
  require_few_dots(text, path);
  return toml::parse(text, path);
}

toml::table read_toml(const std::string& path) {
  constexpr size_t largest = size_t{1} << 20;  // all settings with their comments take 40 kB
  const Bytes bytes = read_file(path, largest);
  return parse_toml(std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()),
                    path);
}

}  // namespace gflow
