// SPDX-License-Identifier: Apache-2.0
// Names that stand in files - of cameras, pictures, experiments - as parts of paths: whoever wrote
// them does not choose where gflow reads and writes.
#pragma once
#include <filesystem>
#include <string>

namespace gflow {

// The name of one file or folder: slashes become _, and none begins with a dot.
inline std::string as_file_name(std::string name) {
  for (char& c : name)
    if (c == '/' || c == '\\' || c == '\0') c = '_';
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
