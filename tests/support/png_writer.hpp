// SPDX-License-Identifier: Apache-2.0
// Writes PNGs of every kind by hand, because no library can write them all.
#pragma once
#include <zlib.h>

#include <random>
#include <string>
#include <vector>

namespace gflow {

inline std::string big_endian(size_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += char(value >> shift & 255);
  return bytes;
}

inline std::string png_chunk(const std::string& name, const std::string& data) {
  const std::string named = name + data;
  const uLong sum = crc32(0, reinterpret_cast<const Bytef*>(named.data()), uInt(named.size()));
  return big_endian(data.size()) + named + big_endian(sum);
}

inline std::string deflated(const std::string& bytes) {
  uLongf size = compressBound(uLong(bytes.size()));
  std::string packed(size, '\0');
  compress(reinterpret_cast<Bytef*>(packed.data()), &size,
           reinterpret_cast<const Bytef*>(bytes.data()), uLong(bytes.size()));
  packed.resize(size);
  return packed;
}

struct PngKind {
  int colour, depth;  // values of IHDR
  bool interlaced, transparent;
};

// Samples per pixel of PNG's colour types.
inline int png_samples(int colour) {
  return colour == 2 ? 3 : colour == 4 ? 2 : colour == 6 ? 4 : 1;
}

constexpr size_t kPngWidth = 13, kPngHeight = 9;

// Unfiltered rows of random bytes, or of 0 and 1 if a colour is transparent. Interlaced images have
// the seven passes of Adam7.
inline std::string random_rows(const PngKind& kind, std::mt19937& rng) {
  struct Pass {
    size_t x, y, dx, dy;
  };
  const std::vector<Pass> adam7{{0, 0, 8, 8}, {4, 0, 8, 8}, {0, 4, 4, 8}, {2, 0, 4, 4},
                                {0, 2, 2, 4}, {1, 0, 2, 2}, {0, 1, 1, 2}};
  std::string rows;
  for (const Pass& p : kind.interlaced ? adam7 : std::vector<Pass>{{0, 0, 1, 1}}) {
    const size_t width = (kPngWidth - p.x + p.dx - 1) / p.dx;
    const size_t bytes = (width * size_t(png_samples(kind.colour) * kind.depth) + 7) / 8;
    for (size_t y = p.y; y < kPngHeight; y += p.dy) {
      rows += '\0';
      for (size_t k = 0; k < bytes; ++k) rows += char(kind.transparent ? rng() & 1 : rng());
    }
  }
  return rows;
}

inline std::string png_of(const PngKind& kind, const std::string& rows,
                          const std::string& more = "") {
  std::string bytes = "\x89PNG\r\n\x1a\n";
  const std::string none(2, '\0');  // compression and filter method
  bytes += png_chunk("IHDR", big_endian(kPngWidth) + big_endian(kPngHeight) + char(kind.depth) +
                                 char(kind.colour) + none + char(kind.interlaced));
  bytes += more;
  if (kind.colour == 3) {
    std::string palette;
    for (int i = 0; i < 3 << kind.depth; ++i) palette += char(37 * i);
    bytes += png_chunk("PLTE", palette);
  }
  if (kind.transparent) {  // palette entries, a grey value, or a colour with samples 1
    const std::string one("\0\1", 2);
    bytes += png_chunk("tRNS", kind.colour == 3   ? "\x10\x80"
                               : kind.colour == 0 ? one
                                                  : one + one + one);
  }
  return bytes + png_chunk("IDAT", deflated(rows)) + png_chunk("IEND", "");
}

}  // namespace gflow
