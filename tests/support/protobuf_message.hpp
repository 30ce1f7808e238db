// SPDX-License-Identifier: Apache-2.0
// Encodes fields of protobuf messages.
#pragma once
#include <string>

namespace gflow {

// A field of fewer than 128 bytes, or of a number below 128.
inline std::string field(int number, const std::string& bytes) {
  return std::string{char(number << 3 | 2), char(bytes.size())} + bytes;
}
inline std::string field(int number, int value) { return {char(number << 3), char(value)}; }

}  // namespace gflow
