// SPDX-License-Identifier: Apache-2.0
// Text from files, names and options, which may hold anything, on its way to a terminal.
#pragma once
#include <fmt/format.h>

#include <string>

namespace gflow {

// As it is but for characters that a terminal obeys (escape, backspace, the C1 controls in UTF-8),
// which are written \x1b. Line ends and tabs stay. Of a long text the middle is left out: the line
// of a file may be all of it.
inline std::string printable(const std::string& text) {
  constexpr size_t most = 65536;  // what a compiler says of a kernel is shorter
  if (text.size() > most) {
    // A letter of UTF-8.
    const auto continues = [&](size_t at) { return (text[at] & 0xc0) == 0x80; };
    size_t end = most / 2, begin = text.size() - most / 2;
    while (end > 0 && continues(end)) --end;
    while (begin < text.size() && continues(begin)) ++begin;
    return fmt::format("{} [... {} bytes ...] {}", printable(text.substr(0, end)), begin - end,
                       printable(text.substr(begin)));
  }
  std::string out;
  for (size_t i = 0; i < text.size(); ++i) {
    const auto at = [&](size_t k) {
      return static_cast<unsigned char>(k < text.size() ? text[k] : 0);
    };
    const bool c1 = at(i) == 0xc2 && at(i + 1) >= 0x80 && at(i + 1) < 0xa0;
    if (c1)
      out += fmt::format("\\x{:02x}", at(++i));
    else if ((at(i) < 0x20 && at(i) != '\n' && at(i) != '\t') || at(i) == 0x7f)
      out += fmt::format("\\x{:02x}", at(i));
    else
      out += text[i];
  }
  return out;
}

}  // namespace gflow
