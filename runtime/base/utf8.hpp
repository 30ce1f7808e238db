// SPDX-License-Identifier: Apache-2.0
// Characters of UTF-8. File names, and the contents of damaged files, need not be valid UTF-8.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace gflow {

// Number of bytes of the character at text[at]; 0 if none begins there: stray bytes, overlong
// forms, surrogates.
inline size_t utf8_letter(std::string_view text, size_t at) {
  const auto lead = static_cast<unsigned char>(text[at]);
  const size_t size = lead < 0x80 ? 1 : lead < 0xe0 ? 2 : lead < 0xf0 ? 3 : 4;
  if (size == 1) return 1;
  if (lead < 0xc2 || lead > 0xf4 || text.size() - at < size) return 0;
  uint32_t code = lead & (0x7fu >> size);
  for (size_t i = at + 1; i < at + size; ++i) {
    if ((text[i] & 0xc0) != 0x80) return 0;
    code = code << 6 | (text[i] & 0x3fu);
  }
  const bool too_long = code < (size == 2 ? 0x80u : size == 3 ? 0x800u : 0x10000u);
  const bool none = (code >= 0xd800 && code < 0xe000) || code > 0x10ffff;
  return too_long || none ? 0 : size;
}

inline bool is_utf8(std::string_view text) {
  for (size_t i = 0; i < text.size();) {
    const size_t size = utf8_letter(text, i);
    if (size == 0) return false;
    i += size;
  }
  return true;
}

}  // namespace gflow
