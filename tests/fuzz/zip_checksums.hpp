// SPDX-License-Identifier: Apache-2.0
// Past the checksums of a zip: what a fuzzer has damaged reaches the reader of the arrays.
#pragma once
#include <zlib.h>

#include <cstdint>
#include <string>

namespace gflow::fuzz {

// A zip of stored entries with the checksums that its bytes have: otherwise nothing that is damaged
// would come past them to what reads the arrays. Other bytes come back as they are.
inline std::string with_checksums(const uint8_t* bytes, size_t size) {
  std::string zip(reinterpret_cast<const char*>(bytes), size);
  const auto number = [&](size_t at, int length) {
    size_t value = 0;
    for (int k = length; k-- > 0;) value = value << 8 | uint8_t(zip[at + size_t(k)]);
    return value;
  };
  // An entry of the directory: its checksum stands at 16, its length at 24, where it is at 42; the
  // entry itself: 30 bytes of which 14 to 17 are the checksum, a name, more (lengths at 26, 28).
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

}  // namespace gflow::fuzz
