// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sstream>
#include <string>
#include <vector>

namespace gflow {

// Breaks a text at spaces into lines of at most `width` bytes; a longer word has a line of its own.
// Lines after the first begin with `indent`. At least one line.
inline std::vector<std::string> wrapped(const std::string& text, size_t width,
                                        const std::string& indent = "") {
  std::vector<std::string> lines{""};
  std::istringstream words(text);
  bool first = true;
  for (std::string word; words >> word; first = false)
    if (!first && lines.back().size() + 1 + word.size() > width)
      lines.push_back(indent + word);
    else
      lines.back() += (first ? "" : " ") + word;
  return lines;
}

}  // namespace gflow
