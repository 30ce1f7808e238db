// SPDX-License-Identifier: Apache-2.0
#include "optim/train/toml_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "optim/io/atomic_file.hpp"
#include "runtime/error.hpp"

namespace gflow {
namespace {

// toml++ 3.3 bounds how deep values are nested, but makes a table of each part of a key a.b.c and
// takes them apart by recursion: thousands end the program. Dots between the characters of keys are
// counted, in texts and comments as well, where a hundred in a row without a space mean nothing.
void require_short_keys(std::string_view text, const std::string& path) {
  constexpr int most = 100;
  int dots = 0, line = 1;
  char last = 0;
  for (const char c : text) {
    const bool of_key = std::isalnum(static_cast<unsigned char>(c)) != 0 ||
                        std::string_view("_-\"' \t").find(c) != std::string_view::npos;
    dots = c == '.' ? dots + (last != '.') : of_key ? dots : 0;
    line += c == '\n';
    last = c;
    if (dots > most)
      throw Error(fmt::format("{}, line {}: a key has more than {} parts, settings have two", path,
                              line, most));
  }
}

}  // namespace

toml::table parse_toml(std::string_view text, const std::string& path) {
  require_short_keys(text, path);
  return toml::parse(text, path);
}

toml::table read_toml(const std::string& path) {
  constexpr size_t largest = size_t{1} << 20;  // all settings take 40 kB with their comments
  const Bytes bytes = read_file(path, largest);
  return parse_toml(std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()),
                    path);
}

}  // namespace gflow
