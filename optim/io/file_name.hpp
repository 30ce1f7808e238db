// SPDX-License-Identifier: Apache-2.0
// Names that stand in files - of cameras, pictures, experiments - as parts of paths: whoever wrote
// them does not choose where gflow reads and writes.
#pragma once
#include <algorithm>
#include <filesystem>
#include <string>

#include "optim/io/printable.hpp"

namespace gflow {

// The name of one file or folder: slashes and what a terminal would obey become _, none begins with
// a dot, and of a long one the first 100 letters are left.
inline std::string as_file_name(std::string name) {
  for (char& c : name)
    if (c == '/' || c == '\\' || static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '_';
  constexpr size_t most_letters = 100;
  size_t end = 0;
  for (size_t n = 0; n < most_letters && end < name.size(); ++n)
    end += std::max<size_t>(utf8_letter(name, end), 1);
  name.resize(end);
  return name.empty() || name[0] == '.' ? "camera" + name : name;
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
