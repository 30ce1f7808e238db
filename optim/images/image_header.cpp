// SPDX-License-Identifier: Apache-2.0
// PNG: chunks of (length, type, data, checksum) up to IEND. JPEG: segments of (marker, length,
// data); in the entropy-coded data after SOS, FF D9 is always the end marker. WebP: a RIFF file.
#include "optim/images/image_header.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <climits>
#include <cstring>

#include "optim/images/byte_source.hpp"
#include "optim/images/decoded_image.hpp"
#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/packed_size.hpp"

namespace gflow {
namespace {

constexpr char png_signature[] = "\x89PNG\r\n\x1a\n";

[[noreturn]] void refuse(const std::string& path, const std::string& why) {
  throw Error(fmt::format("cannot read image {}: {}", path, why));
}

uint32_t big_endian(const uint8_t* b, int n) {
  uint32_t value = 0;
  for (int i = 0; i < n; ++i) value = value << 8 | b[i];
  return value;
}

struct Parsed {
  ImageHeader header;
  size_t data = 0;           // offset of the first compressed byte
  size_t bytes_a_pixel = 3;  // memory of decoding; at least the 3 of RGB that grey becomes
};

// Parses the chunks from IHDR to the first IDAT.
Parsed parse_png(ByteSource& source, const std::string& path) {
  Parsed parsed;
  size_t at = 8;
  uint8_t chunk[8], ihdr[13] = {};
  while (source.read(at, chunk, 8)) {
    const bool is_ihdr = std::memcmp(chunk + 4, "IHDR", 4) == 0;
    if (at == 8 && (!is_ihdr || !source.read(at + 8, ihdr, 13))) break;
    if (is_ihdr) {
      parsed.header.width = int(std::min(big_endian(ihdr, 4), uint32_t(INT_MAX)));
      parsed.header.height = int(std::min(big_endian(ihdr + 4, 4), uint32_t(INT_MAX)));
      parsed.header.has_alpha = ihdr[9] == 4 || ihdr[9] == 6;
      const size_t channels = ihdr[9] == 0 ? 1 : parsed.header.has_alpha ? 4 : 3;
      parsed.bytes_a_pixel = std::max<size_t>(3, channels * (ihdr[8] > 8 ? 2 : 1));
    }
    if (std::memcmp(chunk + 4, "tRNS", 4) == 0 && (ihdr[9] == 2 || ihdr[9] == 3)) {
      parsed.header.has_alpha = true;
      parsed.bytes_a_pixel = ihdr[8] > 8 ? 8 : 4;
    }
    if (std::memcmp(chunk + 4, "IDAT", 4) == 0) {
      parsed.data = at;
      return parsed;
    }
    at += 12 + size_t(big_endian(chunk, 4));
  }
  refuse(path, "its PNG header is truncated or damaged");
}

// Memory that a progressive JPEG's decoder needs beside the pixels: 2 bytes per coefficient of each
// component, until all scans are read. Sampling factors follow the size in the frame header [bytes
// per pixel].
size_t kept_coefficients(ByteSource& source, size_t frame) {
  uint8_t components[1 + 3 * 4] = {};
  source.read(frame + 9, components, 1);
  const size_t count = std::min<size_t>(components[0], 4);
  source.read(frame + 9, components, 1 + 3 * count);
  int samples = 0, most = 1;  // samples per 8 x 8 block of the coarsest component
  for (size_t k = 0; k < count; ++k) {
    const int across = components[2 + 3 * k] >> 4, down = components[2 + 3 * k] & 15;
    samples += across * down;
    most = std::max(most, across * down);
  }
  return size_t((2 * samples + most - 1) / most);
}

// Parses the segments up to SOS.
Parsed parse_jpeg(ByteSource& source, const std::string& path) {
  Parsed parsed;
  parsed.header.format = ImageFormat::jpeg;
  size_t at = 2;
  uint8_t segment[9];
  while (source.read(at, segment, 4) && segment[0] == 0xff) {
    const int marker = segment[1];
    if (marker == 0xff) {  // fill byte
      ++at;
      continue;
    }
    // SOF0..SOF15 without DHT, JPG and DAC, which share the range.
    const bool frame =
        marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
    if (frame && source.read(at, segment, 9)) {
      parsed.header.height = int(big_endian(segment + 5, 2));
      parsed.header.width = int(big_endian(segment + 7, 2));
      if (marker % 4 == 2) parsed.bytes_a_pixel = 3 + kept_coefficients(source, at);
    }
    const size_t next = at + 2 + big_endian(segment + 2, 2);
    if (marker == 0xda && parsed.header.width) {
      parsed.data = next;
      return parsed;
    }
    at = next;
  }
  refuse(path, "its JPEG header is truncated or damaged");
}

// Parses with a library's function.
Parsed parse_by(std::string (*read)(ByteSource&, ImageHeader&), ImageFormat format,
                ByteSource& source, const std::string& path) {
  Parsed parsed;
  parsed.header.format = format;
  parsed.bytes_a_pixel = 4;
  const std::string why = read(source, parsed.header);
  if (!why.empty()) refuse(path, why);
  return parsed;
}

Parsed parse(ByteSource& source, const std::string& path) {
  uint8_t start[12] = {};
  source.read(0, start, std::min(source.size(), sizeof start));
  const auto starts_with = [&](const char* bytes, size_t n) {
    return std::memcmp(start, bytes, n) == 0;
  };
  Parsed parsed;
  if (starts_with(png_signature, 8))
    parsed = parse_png(source, path);
  else if (starts_with("\xff\xd8", 2))
    parsed = parse_jpeg(source, path);
  else if (starts_with("RIFF", 4) && std::memcmp(start + 8, "WEBP", 4) == 0)
    parsed = parse_by(webp_header, ImageFormat::webp, source, path);
  else if (starts_with("II*\0", 4) || starts_with("MM\0*", 4) || starts_with("II+\0", 4) ||
           starts_with("MM\0+", 4))
    parsed = parse_by(tiff_header, ImageFormat::tiff, source, path);
  else
    refuse(path, "it is neither PNG, JPEG, WebP nor TIFF");
  const ImageHeader& h = parsed.header;
  if (h.width < 1 || h.height < 1 || h.width > largest_side || h.height > largest_side)
    refuse(path, fmt::format("its header states {}x{}, expected sides of 1 to {}", h.width,
                             h.height, largest_side));
  return parsed;
}

// Whether the chunks end with IEND. Error if the checksum of a critical chunk is wrong; libpng
// would report that in its own words. Ancillary chunks (lower-case first letter) are not checked.
bool has_whole_chunks(const Bytes& bytes, const std::string& path) {
  for (size_t at = 8; at <= bytes.size() && bytes.size() - at >= 12;) {
    const size_t length = big_endian(bytes.data() + at, 4);
    if (bytes.size() - at - 12 < length) return false;
    const uint8_t* const named = bytes.data() + at + 4;  // type and data are checked
    const bool counts = (named[0] & 0x20) == 0;
    if (counts && crc32(0, named, uInt(length + 4)) != big_endian(named + 4 + length, 4))
      refuse(path, "it is damaged: a PNG checksum is wrong");
    if (std::memcmp(named, "IEND", 4) == 0) return true;
    at += 12 + length;
  }
  return false;
}

bool jpeg_has_end(const Bytes& bytes, size_t at) {
  for (; at + 1 < bytes.size(); ++at)
    if (bytes[at] == 0xff && bytes[at + 1] == 0xd9) return true;
  return false;
}

bool has_end(const Parsed& parsed, const Bytes& bytes, const std::string& path) {
  switch (parsed.header.format) {
    case ImageFormat::png:
      return has_whole_chunks(bytes, path);
    case ImageFormat::jpeg:
      return jpeg_has_end(bytes, parsed.data);
    case ImageFormat::webp: {  // the length of a RIFF file is little-endian
      const size_t length =
          bytes[4] | size_t(bytes[5]) << 8 | size_t(bytes[6]) << 16 | size_t(bytes[7]) << 24;
      return bytes.size() >= 8 + length;
    }
    case ImageFormat::tiff:  // its parts lie in any order; the decoder misses them
      return true;
  }
  return false;
}

}  // namespace

ImageHeader read_image_header(const std::string& path) {
  FileSource source(path);
  return parse(source, path).header;
}

ImageHeader check_image_bytes(const Bytes& bytes, const std::string& path) {
  MemorySource source(bytes);
  const Parsed parsed = parse(source, path);
  if (!has_end(parsed, bytes, path)) refuse(path, "it is truncated");
  // An image of one colour compresses a thousandfold, and films begin black. 256 MB holds an 8K
  // image of 16-bit RGBA.
  constexpr size_t one_colour = size_t{256} << 20;
  const size_t pixels = size_t(parsed.header.width) * size_t(parsed.header.height);
  require_plausible_size(parsed.bytes_a_pixel * pixels, bytes.size(), path, one_colour);
  return parsed.header;
}

}  // namespace gflow
