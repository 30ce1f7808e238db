// SPDX-License-Identifier: Apache-2.0
// Text without upper case, to compare names that people write in either.
#pragma once
#include <cctype>
#include <string>

namespace gflow {

// ASCII letters in lower case; all other bytes as they are.
inline std::string lower(std::string text) {
  for (char& c : text) c = char(std::tolower(static_cast<unsigned char>(c)));
  return text;
}

}  // namespace gflow
