// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <fstream>
#include <string>

namespace gflow {

// Whether a file begins as a zip archive does. Scenes and models are often handed out as one.
inline bool is_zip(const std::string& path) {
  char start[4] = {};
  std::ifstream(path, std::ios::binary).read(start, sizeof start);
  return std::string(start, sizeof start) == "PK\x03\x04";
}

}  // namespace gflow
