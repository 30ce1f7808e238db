// SPDX-License-Identifier: Apache-2.0
// Paths as file:// addresses (RFC 8089, all but plain letters as %XX): file names may be any bytes,
// but TOML and JSON contain only UTF-8.
#pragma once
#include <fmt/format.h>

#include <cctype>
#include <cstdlib>
#include <optional>
#include <string>

namespace gflow {

inline constexpr char file_scheme[] = "file://";

inline bool is_file_address(const std::string& text) { return text.rfind(file_scheme, 0) == 0; }

inline std::string file_address(const std::string& path) {
  std::string address = file_scheme;
  for (const char c : path) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = byte < 0x80 && (std::isalnum(byte) || std::string("/-._~").find(c) < 5);
    address += plain ? std::string(1, c) : fmt::format("%{:02X}", byte);
  }
  return address;
}

// The path of an address; nullopt if a % is not followed by two hexadecimal digits, or by 00.
inline std::optional<std::string> path_of_address(const std::string& address) {
  std::string path;
  for (size_t i = sizeof file_scheme - 1; i < address.size(); ++i) {
    if (address[i] != '%') {
      path += address[i];
      continue;
    }
    const std::string digits = address.substr(i + 1, 2);
    if (digits.size() < 2 || !std::isxdigit(static_cast<unsigned char>(digits[0])) ||
        !std::isxdigit(static_cast<unsigned char>(digits[1])) || digits == "00")
      return std::nullopt;
    path += char(std::strtol(digits.c_str(), nullptr, 16));
    i += 2;
  }
  return path;
}

}  // namespace gflow
