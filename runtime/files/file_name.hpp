// SPDX-License-Identifier: Apache-2.0
// Paths from names in files (of cameras, images, experiments): the author of a file must not choose
// where gflow reads and writes.
#pragma once
#include <algorithm>
#include <filesystem>
#include <string>

#include "runtime/base/hash.hpp"
#include "runtime/base/printable.hpp"

namespace gflow {

// The name of one file or folder. Slashes and characters that a terminal obeys become _, and a name
// that is empty or begins with a dot gets the prefix "camera". Names are cut at 100 characters or
// 200 bytes, since file systems take 255 bytes and suffixes need room. A name that was cut, or had
// characters that a terminal obeys, ends in a hash of the original: different names stay different.
inline std::string as_file_name(const std::string& name) {
  constexpr size_t most_letters = 100, most_bytes = 200;
  std::string plain;
  size_t at = 0;
  bool changed = false;
  for (size_t n = 0; n < most_letters && at < name.size(); ++n) {
    const size_t size = utf8_letter(name, at);  // 0: an invalid byte, which stays
    std::string letter = name.substr(at, std::max<size_t>(size, 1)), shown;
    if (plain.size() + letter.size() > most_bytes) break;
    append_letter(shown, letter, 0);
    at += letter.size();
    const bool slash = letter == "/" || letter == "\\", obeyed = size > 0 && shown != letter;
    changed |= obeyed;
    plain += slash || obeyed ? "_" : letter;
  }
  if (changed || at < name.size()) plain += fmt::format("-{:016x}", hash(name));
  return plain.empty() || plain[0] == '.' ? "camera" + plain : plain;
}

// FOLDER/NAME. The name may contain folders but must not lead outside; else it becomes a single
// name (as_file_name).
inline std::filesystem::path path_below(const std::filesystem::path& folder,
                                        const std::string& name) {
  const std::filesystem::path inner = std::filesystem::path(name).lexically_normal();
  const bool stays = !inner.empty() && inner.is_relative() && *inner.begin() != "..";
  return folder / (stays ? inner : std::filesystem::path(as_file_name(name)));
}

}  // namespace gflow
