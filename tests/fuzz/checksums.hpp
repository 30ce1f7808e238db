// SPDX-License-Identifier: Apache-2.0
// Corrects the checksums of damaged zip archives and PNGs, so that damage reaches the readers of
// their contents.
#pragma once
#include <zlib.h>

#include <cstdint>
#include <string>

namespace gflow::fuzz {

// A zip of stored entries with checksums that match its bytes. Otherwise the checksum would reject
// every damaged array before it is read. Other bytes are returned unchanged.
inline std::string with_checksums(const uint8_t* bytes, size_t size) {
  std::string zip(reinterpret_cast<const char*>(bytes), size);
  const auto number = [&](size_t at, int length) {
    size_t value = 0;
    for (int k = length; k-- > 0;) value = value << 8 | uint8_t(zip[at + size_t(k)]);
    return value;
  };
  // A directory entry: checksum at 16, length at 24, position of the entry at 42. The entry itself:
  // 30 bytes with the checksum at 14 to 17, a name, extra data (their lengths at 26 and 28).
  for (size_t at = zip.find("PK\1\2"); at != std::string::npos; at = zip.find("PK\1\2", at + 1)) {
    if (at + 46 > zip.size()) break;
    const size_t length = number(at + 24, 4), entry = number(at + 42, 4);
    if (entry + 30 > zip.size()) continue;
    const size_t begin = entry + 30 + number(entry + 26, 2) + number(entry + 28, 2);
    if (begin > zip.size() || zip.size() - begin < length) continue;
    const uLong sum = crc32(0, reinterpret_cast<const Bytef*>(zip.data()) + begin, uInt(length));
    for (size_t k = 0; k < 4; ++k)
      zip[at + 16 + k] = zip[entry + 14 + k] = char(sum >> (8 * k) & 255);
  }
  return zip;
}

// The same for a PNG: its signature is followed by chunks of length, name, data, and the checksum
// of name and data.
inline std::string with_png_checksums(const uint8_t* bytes, size_t size) {
  std::string png(reinterpret_cast<const char*>(bytes), size);
  for (size_t at = 8; at + 12 <= png.size();) {
    size_t length = 0;
    for (size_t k = 0; k < 4; ++k) length = length << 8 | uint8_t(png[at + k]);
    if (length > png.size() - at - 12) break;
    const auto* named = reinterpret_cast<const Bytef*>(png.data()) + at + 4;
    const uLong sum = crc32(0, named, uInt(length + 4));
    for (size_t k = 0; k < 4; ++k) png[at + 8 + length + k] = char(sum >> (8 * (3 - k)) & 255);
    at += 12 + length;
  }
  return png;
}

}  // namespace gflow::fuzz
