// SPDX-License-Identifier: Apache-2.0
#include "runtime/files/modest_json.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "runtime/base/error.hpp"
#include "runtime/base/printable.hpp"

namespace gflow {
namespace {

// Twenty thousand cameras of forty values each take 16 MB.
constexpr size_t most_values = 800000;            // each takes up to 80 bytes of memory: 64 MB
constexpr size_t longest_text = size_t{1} << 20;  // the parser holds a text up to four times
constexpr size_t most_blanks = size_t{1} << 20;   // in a row: quoted at eight bytes each
constexpr int deepest_json = 100;  // a level takes 100 bytes of memory and one of the file

}  // namespace

// Checked before parsing, since the parser's own callback takes time quadratic in a list's length
// (nlohmann-json 3.11 goes through the list whenever an entry ends).
void require_json_limits(const void* text, size_t size, const std::string& path) {
  const char* json = static_cast<const char*>(text);
  int depth = 0, deepest = 0;
  size_t values = 1;
  bool in_text = false;
  size_t begin = 0, longest = 0;  // of texts [bytes]
  size_t blanks = 0, most = 0;    // in a row, outside of texts
  for (size_t i = 0; i < size; ++i) {
    const char c = json[i];
    blanks = !in_text && (c == ' ' || c == '\n' || c == '\t' || c == '\r') ? blanks + 1 : 0;
    most = std::max(most, blanks);
    if (in_text && c == '\\')
      ++i;
    else if (c == '"') {
      if (in_text) longest = std::max(longest, i - begin - 1);
      in_text = !in_text;
      begin = i;
    } else if (in_text)
      continue;
    else if (c == '[' || c == '{')
      deepest = std::max(deepest, ++depth), ++values;
    else if (c == ']' || c == '}')
      --depth;
    else if (c == ',')
      ++values;
  }
  // The parser takes a zero byte for the end, whatever follows.
  if (const void* zero = size > 0 ? std::memchr(text, 0, size) : nullptr)
    throw Error(fmt::format("cannot read {}: it is not valid JSON (byte {} is zero)", path,
                            static_cast<const char*>(zero) - json));
  if (in_text) longest = std::max(longest, size - begin);  // it is not terminated
  if (deepest > deepest_json)
    throw Error(fmt::format("cannot read {}: its JSON is nested more than {} levels deep", path,
                            deepest_json));
  if (longest > longest_text)
    throw Error(fmt::format("cannot read {}: it has a string of {} bytes; at most {} are allowed",
                            path, longest, longest_text));
  if (most > most_blanks)
    throw Error(fmt::format(
        "cannot read {}: it has {} consecutive whitespace characters; at most {} are allowed", path,
        most, most_blanks));
  if (values > most_values)
    throw Error(fmt::format("cannot read {}: it has {} values; at most {} are allowed", path,
                            values, most_values));
}

bool is_within_json_limits(const void* text, size_t size) {
  try {
    require_json_limits(text, size, "");
    return true;
  } catch (const Error&) {
    return false;
  }
}

nlohmann::ordered_json parse_json_within_limits(std::string_view text) {
  using Json = nlohmann::ordered_json;
  return is_within_json_limits(text.data(), text.size()) ? Json::parse(text, nullptr, false)
                                                         : Json(Json::value_t::discarded);
}

std::string reason_of(const nlohmann::json::exception& problem) {
  constexpr size_t most_letters = 200;      // the message quotes the last token in full
  const std::string text = problem.what();  // "[json.exception.type_error.302] type must be ..."
  const size_t end = text.find("] ");
  const bool tagged = text.rfind("[json.exception", 0) == 0 && end != text.npos;
  return excerpt(tagged ? text.substr(end + 2) : text, most_letters);
}

}  // namespace gflow
