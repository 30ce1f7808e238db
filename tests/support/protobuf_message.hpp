// SPDX-License-Identifier: Apache-2.0
// Fields of protobuf messages, made by hand.
#pragma once
#include <string>

namespace gflow {

// A field of bytes, shorter than 128, and one of a number below that.
inline std::string field(int number, const std::string& bytes) {
  return std::string{char(number << 3 | 2), char(bytes.size())} + bytes;
}
inline std::string field(int number, int value) { return {char(number << 3), char(value)}; }

}  // namespace gflow
