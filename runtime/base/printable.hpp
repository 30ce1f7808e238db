// SPDX-License-Identifier: Apache-2.0
// Makes text from files, names and options, which may contain anything, safe for a terminal.
#pragma once
#include <fmt/format.h>

#include <string>

#include "runtime/base/utf8.hpp"

namespace gflow {

// Appends the character at text[at] and returns the position behind it. Bytes that are not UTF-8
// and characters that a terminal obeys (escape, backspace, line ends, C1 controls, marks that
// change the direction of writing) are written as \x1b and the like.
inline size_t append_letter(std::string& out, const std::string& text, size_t at) {
  const size_t size = utf8_letter(text, at);
  const auto first = static_cast<unsigned char>(text[at]);
  const auto last = static_cast<unsigned char>(text[at + (size > 0 ? size - 1 : 0)]);
  const bool control = first < 0x20 || first == 0x7f || (first == 0xc2 && last < 0xa0);
  const std::string letter = text.substr(at, size);
  const bool turns = (letter >= "\u202a" && letter <= "\u202e") ||  // they reorder what follows
                     (letter >= "\u2066" && letter <= "\u2069");
  if (size == 0 || control)
    out += fmt::format("\\x{:02x}", last);
  else if (turns)
    for (const char byte : letter) out += fmt::format("\\x{:02x}", uint8_t(byte));
  else
    out += letter;
  return at + (size > 0 ? size : 1);
}

// Text of several lines: characters as above, but line ends and tabs stay.
inline std::string printable_lines(const std::string& text) {
  std::string out;
  for (size_t i = 0; i < text.size();)
    if (text[i] == '\n' || text[i] == '\t')
      out += text[i++];
    else
      i = append_letter(out, text, i);
  return out;
}

// A whole message: lines, with the middle of a long text left out.
inline std::string printable(const std::string& text) {
  constexpr size_t most = 65536;  // longer than a compiler's log of a kernel
  if (text.size() > most) {
    // whether this byte continues a UTF-8 character
    const auto continues = [&](size_t at) { return (text[at] & 0xc0) == 0x80; };
    size_t end = most / 2, begin = text.size() - most / 2;
    while (end > 0 && continues(end)) --end;
    while (begin < text.size() && continues(begin)) ++begin;
    return fmt::format("{} [... {} bytes ...] {}", printable(text.substr(0, end)), begin - end,
                       printable(text.substr(begin)));
  }
  return printable_lines(text);
}

// Text from a file or an option, quoted in a message: one line, no longer than needed to find it.
inline std::string excerpt(const std::string& text, size_t most_letters = 60) {
  std::string out;
  size_t at = 0;
  for (size_t n = 0; n < most_letters && at < text.size(); ++n) at = append_letter(out, text, at);
  return at < text.size() ? out + "..." : out;
}

}  // namespace gflow
