// SPDX-License-Identifier: Apache-2.0
// The base of all errors. Each message is one clear sentence for the person who must act: what was
// being done, to what, what is wrong, what would be right.
#pragma once
#include <stdexcept>
#include <string>
#include <utility>

namespace gflow {

// Text from a file may contain NUL bytes, at which what() would end: they become "\\0".
inline std::string without_zeros(std::string text) {
  for (size_t at = text.find('\0'); at != text.npos; at = text.find('\0', at + 2))
    text.replace(at, 1, "\\0");
  return text;
}

// Base of all errors of gflow; what() is a full sentence for the user.
struct Error : std::runtime_error {
  explicit Error(std::string sentence) : std::runtime_error(without_zeros(std::move(sentence))) {}
};

}  // namespace gflow
