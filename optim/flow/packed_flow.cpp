// SPDX-License-Identifier: Apache-2.0
// Layout, little-endian: Header; then one zlib stream of the low bytes of all residuals of u and of
// v, their high bytes, and one bit per pixel each for valid and trusted. A residual is the
// difference to left + above - above left, modulo 2^16, with its sign in the lowest bit.
#include "optim/flow/packed_flow.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>

#include "runtime/base/error.hpp"

namespace gflow {
namespace {

constexpr char tag[8] = {'g', 'f', 'l', 'o', 'w', 'u', 'v', '1'};
constexpr uint32_t finest = 64;      // units per pixel
constexpr uint32_t largest = 32767;  // [units]
constexpr uint32_t longest_side = 1u << 14;
constexpr size_t most_expanded = 1032;  // largest expansion factor of zlib (its manual)

struct Header {
  char tag[8];
  uint32_t width, height;
  uint32_t units;   // units per pixel: 64, 32, ... 1
  uint32_t length;  // of the zlib stream [bytes]
  uint32_t crc;     // of the header before it, and of the stream
};
static_assert(sizeof(Header) == 28);

uint32_t crc_of(const Header& header, const uint8_t* stream) {
  const uLong crc = crc32(0, reinterpret_cast<const Bytef*>(&header), offsetof(Header, crc));
  return uint32_t(crc32(crc, stream, header.length));
}

// Offsets of the parts of the expanded stream.
struct Parts {
  size_t pixels, low, high, valid, trusted, end;
  explicit Parts(size_t n)
      : pixels(n),
        low(0),
        high(2 * n),
        valid(4 * n),
        trusted(valid + (n + 7) / 8),
        end(trusted + (n + 7) / 8) {}
};

bool is_storable(float u, float v) {
  return std::fabs(u) <= float(largest) && std::fabs(v) <= float(largest);  // false for NaN
}

uint32_t units_for(const FlowField& flow) {
  float longest = 0;
  for (size_t i = 0; i < flow.valid.size(); ++i) {
    const float u = flow.uv[2 * i], v = flow.uv[2 * i + 1];
    if (flow.valid[i] && is_storable(u, v))
      longest = std::max({longest, std::fabs(u), std::fabs(v)});
  }
  uint32_t units = finest;
  while (longest * float(units) > float(largest)) units /= 2;
  return units;
}

// left + above - above left in a row-major plane; values outside are 0.
uint16_t predicted(const uint16_t* plane, int width, int x, int y) {
  const size_t i = size_t(y) * size_t(width) + size_t(x);
  const int left = x ? plane[i - 1] : 0;
  const int above = y ? plane[i - size_t(width)] : 0;
  const int corner = x && y ? plane[i - size_t(width) - 1] : 0;
  return uint16_t(left + above - corner);
}

uint16_t sign_last(uint16_t residual) {
  return uint16_t(residual << 1) ^ uint16_t(residual & 0x8000 ? 0xffff : 0);
}
uint16_t sign_first(uint16_t coded) {
  return uint16_t(coded >> 1) ^ uint16_t(coded & 1 ? 0xffff : 0);
}

// Z_RLE: residuals repeat only as runs of zeros. Searching for other matches is slower and gains
// nothing.
Bytes deflated(const Bytes& bytes) {
  z_stream stream{};
  if (deflateInit2(&stream, 1, Z_DEFLATED, MAX_WBITS, 9, Z_RLE) != Z_OK)
    throw Error("cannot compress flow: zlib failed to initialise");
  const std::unique_ptr<z_stream, int (*)(z_stream*)> guard(&stream, deflateEnd);
  Bytes result(sizeof(Header) + deflateBound(&stream, uLong(bytes.size())));
  stream.next_in = const_cast<Bytef*>(bytes.data());
  stream.avail_in = uInt(bytes.size());
  stream.next_out = result.data() + sizeof(Header);
  stream.avail_out = uInt(result.size() - sizeof(Header));
  if (deflate(&stream, Z_FINISH) != Z_STREAM_END)
    throw Error(fmt::format("cannot compress a flow of {} bytes", bytes.size()));
  result.resize(result.size() - stream.avail_out);
  return result;
}

}  // namespace

Bytes packed(const TargetFlow& target_flow) {
  const FlowField& flow = target_flow.flow;
  if (uint32_t(flow.width) > longest_side || uint32_t(flow.height) > longest_side)
    throw Error(fmt::format("cannot store a flow of {}x{} pixels: the longest side supported is {}",
                            flow.width, flow.height, longest_side));
  const Parts parts(flow.valid.size());
  const uint32_t units = units_for(flow);
  Bytes bytes(parts.end);
  std::vector<uint16_t> planes(2 * parts.pixels);
  for (size_t i = 0; i < parts.pixels; ++i) {
    const float u = flow.uv[2 * i], v = flow.uv[2 * i + 1];
    if (!flow.valid[i] || !is_storable(u, v)) continue;
    planes[i] = uint16_t(std::lrint(u * float(units)));
    planes[parts.pixels + i] = uint16_t(std::lrint(v * float(units)));
    const uint8_t bit = uint8_t(1u << (i % 8));
    bytes[parts.valid + i / 8] |= bit;
    if (target_flow.confidence[i] > 127) bytes[parts.trusted + i / 8] |= bit;
  }
  size_t i = 0;
  for (const uint16_t* plane : {planes.data(), planes.data() + parts.pixels})
    for (int y = 0; y < flow.height; ++y)
      for (int x = 0; x < flow.width; ++x, ++i) {
        const uint16_t coded = sign_last(uint16_t(planes[i] - predicted(plane, flow.width, x, y)));
        bytes[parts.low + i] = uint8_t(coded & 255);
        bytes[parts.high + i] = uint8_t(coded >> 8);
      }
  Bytes result = deflated(bytes);
  Header header{{},
                uint32_t(flow.width),
                uint32_t(flow.height),
                units,
                uint32_t(result.size() - sizeof(Header)),
                0};
  std::memcpy(header.tag, tag, sizeof(tag));
  header.crc = crc_of(header, result.data() + sizeof(Header));
  std::memcpy(result.data(), &header, sizeof(Header));
  return result;
}

TargetFlow unpacked(const Bytes& bytes, const std::string& name) {
  const auto damaged = [&](const char* what) {
    return Error(fmt::format("{} is damaged: {}", name, what));
  };
  Header header;
  if (bytes.size() < sizeof(Header)) throw damaged("it ends within its header");
  std::memcpy(&header, bytes.data(), sizeof(Header));
  if (std::memcmp(header.tag, tag, sizeof(tag)) != 0) throw damaged("it is not a packed flow");
  if (header.length != bytes.size() - sizeof(Header)) throw damaged("its length is wrong");
  const uint8_t* stream = bytes.data() + sizeof(Header);
  if (crc_of(header, stream) != header.crc) throw damaged("its checksum is wrong");

  // The checksum may match by chance, so the size is bounded by what the stream can expand to
  // before memory is allocated.
  const bool sized = header.width > 0 && header.width <= longest_side && header.height > 0 &&
                     header.height <= longest_side;
  if (!sized || Parts(size_t(header.width) * header.height).end > most_expanded * header.length)
    throw damaged("it does not decompress to a flow of its size");
  if (header.units == 0 || header.units > finest) throw damaged("its unit is invalid");
  const int width = int(header.width), height = int(header.height);
  TargetFlow target_flow{zero_flow(width, height), {}};
  const Parts parts(target_flow.flow.valid.size());
  Bytes expanded(parts.end);
  uLongf length = uLongf(expanded.size());
  if (uncompress(expanded.data(), &length, stream, header.length) != Z_OK || length != parts.end)
    throw damaged("it does not decompress to a flow of its size");
  target_flow.confidence.resize(parts.pixels);
  std::vector<uint16_t> plane(parts.pixels);
  const float unit = 1 / float(header.units);
  for (size_t c = 0; c < 2; ++c) {
    const uint8_t* low = &expanded[parts.low + c * parts.pixels];
    const uint8_t* high = &expanded[parts.high + c * parts.pixels];
    size_t i = 0;
    for (int y = 0; y < height; ++y)
      for (int x = 0; x < width; ++x, ++i) {
        const uint16_t coded = uint16_t(low[i] | high[i] << 8);
        plane[i] = uint16_t(predicted(plane.data(), width, x, y) + sign_first(coded));
        target_flow.flow.uv[2 * i + c] = float(int16_t(plane[i])) * unit;
      }
  }
  for (size_t i = 0; i < parts.pixels; ++i) {
    target_flow.flow.valid[i] = expanded[parts.valid + i / 8] >> (i % 8) & 1;
    target_flow.confidence[i] = expanded[parts.trusted + i / 8] >> (i % 8) & 1 ? 255 : 0;
  }
  return target_flow;
}

bool holds_packed_flow(const std::string& path, int width, int height) {
  std::error_code failed;
  const auto size = std::filesystem::file_size(path, failed);
  std::ifstream file(path, std::ios::binary);
  Header header;
  if (failed || !file.read(reinterpret_cast<char*>(&header), sizeof(Header))) return false;
  return std::memcmp(header.tag, tag, sizeof(tag)) == 0 && header.width == uint32_t(width) &&
         header.height == uint32_t(height) && sizeof(Header) + header.length == size;
}

}  // namespace gflow
