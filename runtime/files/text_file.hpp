// SPDX-License-Identifier: Apache-2.0
// Small files of text that another process may be changing.
#pragma once
#include <algorithm>
#include <filesystem>
#include <string>
#include <string_view>

#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"

namespace gflow {

// A file as text, "" where there is none (any longer: a training may remove it meanwhile). Error
// that names it when it cannot be read.
inline std::string text_if_there(const std::string& path) {
  try {
    const Bytes bytes = read_file(path);
    return {bytes.begin(), bytes.end()};
  } catch (const Error&) {
    std::error_code none;
    if (std::filesystem::exists(path, none) || none) throw;
    return "";
  }
}

// The same of what gflow writes in one piece, results or a stamp; "" also where there are more than
// 16 MiB: that is nothing of the kind.
inline std::string report_if_there(const std::string& path) {
  constexpr uintmax_t longest = uintmax_t{16} << 20;
  std::error_code none;
  const uintmax_t size = std::filesystem::file_size(path, none);
  return !none && size > longest ? "" : text_if_there(path);
}

// The first line of a text that has any, without its end; the text begins behind it then.
inline std::string_view take_line(std::string_view& text) {
  const std::string_view line = text.substr(0, text.find('\n'));
  text.remove_prefix(std::min(text.size(), line.size() + 1));
  return line;
}

}  // namespace gflow
