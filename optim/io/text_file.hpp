// SPDX-License-Identifier: Apache-2.0
// Small files of text that another process may be changing.
#pragma once
#include <filesystem>
#include <string>

#include "optim/io/atomic_file.hpp"
#include "runtime/error.hpp"

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

}  // namespace gflow
