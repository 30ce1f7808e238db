// SPDX-License-Identifier: Apache-2.0
#include "runtime/files/toml_file.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"
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

// The parser's most frequent complaints in our words.
std::string in_our_words(const std::string& said) {
  const auto has = [&](const char* words) { return said.find(words) != said.npos; };
  if (has("floating-point") && has("could not be interpreted as a value"))  // 1e999
    return fmt::format(
        "the number {} is out of range",
        excerpt(said.substr(said.find('\''), said.rfind('\'') + 1 - said.find('\''))));
  if (has("cannot redefine")) return "this name is already used above";
  if (has("end-of-file")) return "the text ends too early; a bracket or quote is not closed";
  if (has("control characters"))
    return "a quote is not closed in its line, or the text has a control character";
  if (has("determine value type") || has("expected value,") || has("integer:") ||
      has("floating-point:") || has("boolean:"))
    return "the value is missing or malformed; text needs quotes";
  if (has("expected '='")) return "there is no '=' after the name";
  if (has("utf-8")) return "the text is not UTF-8";
  return "this is not valid TOML; a setting is written as name = value, and text needs quotes";
}

}  // namespace

std::string toml_problem(const std::string& name, const toml::parse_error& problem) {
  const auto at = problem.source().begin;
  const std::string place =
      at.line ? fmt::format("{}, line {}, column {}", name, at.line, at.column) : name;
  return fmt::format("{}: {}", place, in_our_words(std::string(problem.description())));
}

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
