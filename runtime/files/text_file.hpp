// SPDX-License-Identifier: Apache-2.0
// Small text files that another process may be changing.
#pragma once
#include <algorithm>
#include <filesystem>
#include <string>
#include <string_view>

#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {

// Contents of a text file, "" if it does not exist (any more: a training may remove it meanwhile).
// Error that names it if it cannot be read.
inline std::string read_text_or_empty(const std::string& path) {
  try {
    const Bytes bytes = read_file(path);
    return {bytes.begin(), bytes.end()};
  } catch (const Error&) {
    std::error_code none;
    if (std::filesystem::exists(path, none) || none) throw;
    return "";
  }
}

// The same for what gflow writes in one piece, such as results; "" also for more than 16 MiB, which
// those never have.
inline std::string read_report_or_empty(const std::string& path) {
  constexpr uintmax_t longest = uintmax_t{16} << 20;
  std::error_code none;
  const uintmax_t size = std::filesystem::file_size(path, none);
  return !none && size > longest ? "" : read_text_or_empty(path);
}

// Removes the first line of a text that is not empty, and returns it without its end.
inline std::string_view take_line(std::string_view& text) {
  const std::string_view line = text.substr(0, text.find('\n'));
  text.remove_prefix(std::min(text.size(), line.size() + 1));
  return line;
}

}  // namespace gflow
