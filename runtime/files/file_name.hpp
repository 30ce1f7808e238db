// SPDX-License-Identifier: Apache-2.0
// Names that stand in files - of cameras, pictures, experiments - as parts of paths: whoever wrote
// them does not choose where gflow reads and writes.
#pragma once
#include <algorithm>
#include <filesystem>
#include <string>

#include "runtime/base/hash.hpp"
#include "runtime/base/printable.hpp"

namespace gflow {

// The name of one file or folder: slashes become _, and none begins with a dot. Of a long one the
// first 100 letters, or 200 bytes of them, are left, letters that a terminal would obey become _,
// and behind such a name stands a hash of the whole: what differed differs. File systems take 255
// bytes: there is room for what else a file's name says.
inline std::string as_file_name(const std::string& name) {
  constexpr size_t most_letters = 100, most_bytes = 200;
  std::string plain;
  size_t at = 0;
  bool changed = false;
  for (size_t n = 0; n < most_letters && at < name.size(); ++n) {
    const size_t size = utf8_letter(name, at);  // 0: some other byte, which stays
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

// FOLDER/NAME, where the name may have folders of its own but leads to nowhere else; else as a
// single name.
inline std::filesystem::path path_below(const std::filesystem::path& folder,
                                        const std::string& name) {
  const std::filesystem::path inner = std::filesystem::path(name).lexically_normal();
  const bool stays = !inner.empty() && inner.is_relative() && *inner.begin() != "..";
  return folder / (stays ? inner : std::filesystem::path(as_file_name(name)));
}

}  // namespace gflow
