// SPDX-License-Identifier: Apache-2.0
// Text from files, names and options, which may hold anything, on its way to a terminal.
#pragma once
#include <fmt/format.h>

#include <string>

#include "runtime/base/utf8.hpp"

namespace gflow {

// Appends the letter at text[at], or \x1b for what a terminal obeys (escape, backspace, line ends,
// the C1 controls in UTF-8, marks that turn the direction of writing) and for a byte that is no
// UTF-8; the place behind it.
inline size_t append_letter(std::string& out, const std::string& text, size_t at) {
  const size_t size = utf8_letter(text, at);
  const auto first = static_cast<unsigned char>(text[at]);
  const auto last = static_cast<unsigned char>(text[at + (size > 0 ? size - 1 : 0)]);
  const bool control = first < 0x20 || first == 0x7f || (first == 0xc2 && last < 0xa0);
  const std::string letter = text.substr(at, size);
  const bool turns = (letter >= "\u202a" && letter <= "\u202e") ||  // the order of what follows
                     (letter >= "\u2066" && letter <= "\u2069");
  if (size == 0 || control)
    out += fmt::format("\\x{:02x}", last);
  else if (turns)
    for (const char byte : letter) out += fmt::format("\\x{:02x}", uint8_t(byte));
  else
    out += letter;
  return at + (size > 0 ? size : 1);
}

// Lines: letters as above, but line ends and tabs stay.
inline std::string printable_lines(const std::string& text) {
  std::string out;
  for (size_t i = 0; i < text.size();)
    if (text[i] == '\n' || text[i] == '\t')
      out += text[i++];
    else
      i = append_letter(out, text, i);
  return out;
}

// A whole message: lines, and of a long text the middle is left out.
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
  return printable_lines(text);
}

// What a file or an option says, within a message: one line whatever it holds, and no more of it
// than one needs to find it there.
inline std::string excerpt(const std::string& text, size_t most_letters = 60) {
  std::string out;
  size_t at = 0;
  for (size_t n = 0; n < most_letters && at < text.size(); ++n) at = append_letter(out, text, at);
  return at < text.size() ? out + "..." : out;
}

}  // namespace gflow
