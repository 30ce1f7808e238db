// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>

namespace gflow {

inline constexpr uint64_t hash_begin = 14695981039346656037u;

// FNV-1a hash, 64 bits, continued from `h`. For names; it does not resist forgery.
inline uint64_t hash(const char* bytes, size_t size, uint64_t h = hash_begin) {
  for (size_t i = 0; i < size; ++i) h = (h ^ uint8_t(bytes[i])) * 1099511628211u;
  return h;
}
inline uint64_t hash(const std::string& text, uint64_t h = hash_begin) {
  return hash(text.data(), text.size(), h);
}

}  // namespace gflow
