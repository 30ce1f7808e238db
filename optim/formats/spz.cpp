// SPDX-License-Identifier: Apache-2.0
// A 16-byte header, then the attributes of all Gaussians, one attribute after the other:
//   positions  3 x 24-bit fixed point; opacities u8; colours 3 u8 of 0.15 sh0 + 0.5;
//   scales     3 u8, log scale = u8/16 - 10
//   rotations  version 2: x y z as u8 of 127.5 (1 + q), w >= 0 is omitted;
//              version 3: 2 bits for the index of the largest of x y z w, which is omitted, then
//              sign and 9 bits for each of the others
//   harmonics  u8 of 128 (1 + sh), colour by colour within a coefficient
// Version 4 has the attributes of version 3, each in a zstd frame, and a 32-byte header: the last
// byte of the 16 is the number of frames, u32 the offset of their table, 12 bytes are reserved. The
// table has the packed and the unpacked size of each frame as u64; the frames follow it. Extensions
// between header and table are skipped.
#include "optim/formats/spz.hpp"

#include <fmt/format.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>

#include "optim/formats/splat_dialects.hpp"
#include "optim/formats/splat_table.hpp"
#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/packed_size.hpp"

namespace gflow {
namespace {

constexpr uint32_t kMagic = 0x5053474e;  // "NGSP"
constexpr uint8_t kAntialiased = 1;      // bit of the flags: trained with antialiasing

struct SpzHeader {
  uint32_t magic, version, count;
  uint8_t sh_degree, fraction_bits, flags, frames;  // frames: 0 before version 4
};
static_assert(sizeof(SpzHeader) == 16);

[[noreturn]] void throw_spz_error(const std::string& path, const std::string& why) {
  throw Error(fmt::format("cannot read {}: {}", path, why));
}

double fixed24(const uint8_t* bytes, int fraction_bits) {
  const int32_t high = int8_t(bytes[2]);
  return std::ldexp(double(high * 65536 + bytes[1] * 256 + bytes[0]), -fraction_bits);
}

std::array<double, 4> with_largest(std::array<double, 4> xyzw, size_t largest) {
  double rest = 1;
  for (size_t i = 0; i < 4; ++i)
    if (i != largest) rest -= xyzw[i] * xyzw[i];
  xyzw[largest] = std::sqrt(std::max(rest, 0.0));
  return xyzw;
}

// Returns x y z w.
std::array<double, 4> unpack_quat(const uint8_t* bytes, uint32_t version) {
  std::array<double, 4> q{};
  if (version == 2) {
    for (size_t k = 0; k < 3; ++k) q[k] = bytes[k] / 127.5 - 1;
    return with_largest(q, 3);
  }
  uint32_t word;
  std::memcpy(&word, bytes, sizeof word);
  const size_t largest = word >> 30;
  for (size_t i = 4; i-- > 0;) {
    if (i == largest) continue;
    q[i] = std::sqrt(0.5) * double(word & 511) / 511 * (word & 512 ? -1 : 1);
    word >>= 10;
  }
  return with_largest(q, largest);
}

// Signs of the SH coefficients above degree 0 under a rotation by 180 degrees around x: the sign of
// each polynomial (kernels/shared/sh.h) with -y and -z for y and z.
constexpr std::array<float, 15> kTurned{-1, -1, 1, -1, 1, 1, -1, 1, -1, 1, -1, -1, 1, -1, 1};

SpzHeader read_header(const Bytes& bytes, const std::string& path) {
  SpzHeader header{};
  if (bytes.size() < sizeof header) throw_spz_error(path, "it is truncated: it has no header");
  std::memcpy(&header, bytes.data(), sizeof header);
  if (header.magic != kMagic)
    throw_spz_error(path, "it is not an .spz file: it does not start with 'NGSP'");
  if (header.version < 2 || header.version > 4)
    throw_spz_error(
        path,
        fmt::format("it is .spz version {}, but gflow only reads 2 to 4; save it as one of these "
                    "or as a PLY",
                    header.version));
  if (header.sh_degree > 3)
    throw_spz_error(
        path, fmt::format("its spherical harmonics have degree {}, but gflow only reads 0 to 3",
                          header.sh_degree));
  constexpr int most_bits = 24;  // of a position in all
  if (header.fraction_bits > most_bits)
    throw_spz_error(path,
                    fmt::format("its positions have {} fractional bits, but only {} bits in total",
                                header.fraction_bits, most_bits));
  return header;
}

size_t coefficients_of(const SpzHeader& header) {
  return size_t((header.sh_degree + 1) * (header.sh_degree + 1) - 1);
}
size_t quat_bytes_of(const SpzHeader& header) { return header.version == 2 ? 3 : 4; }
size_t bytes_each(const SpzHeader& header) {
  return 9 + 1 + 3 + 3 + quat_bytes_of(header) + 3 * coefficients_of(header);
}
constexpr size_t kMostBehind = 1 << 20;  // other programs may append data after the Gaussians

// Error if the attributes of that many Gaussians cannot be packed in a file of `stored` bytes.
void require_plausible_count(const SpzHeader& header, size_t stored, const std::string& path) {
  constexpr size_t equal = 1 << 20;  // no real scene has this many equal Gaussians
  require_plausible_size(sizeof header + header.count * bytes_each(header), stored, path, equal);
}

// The bytes of version 3 from those of version 4.
Bytes unpack_frames(const Bytes& stored, const std::string& path) {
  const SpzHeader header = read_header(stored, path);
  constexpr size_t long_header = 32, entry = 2 * sizeof(uint64_t);
  uint32_t table = 0;
  if (stored.size() >= long_header)
    std::memcpy(&table, stored.data() + sizeof header, sizeof table);
  size_t from = table + header.frames * entry, to = sizeof header;
  if (table < long_header || from > stored.size())
    throw_spz_error(path, "it is truncated: it ends before its table of frames does");
  require_plausible_count(header, stored.size(), path);
  Bytes bytes(sizeof header + header.count * bytes_each(header));
  std::memcpy(bytes.data(), &header, sizeof header);
  for (size_t i = 0; i < header.frames; ++i) {
    std::array<uint64_t, 2> sizes;  // packed, unpacked
    std::memcpy(sizes.data(), stored.data() + table + i * entry, entry);
    if (sizes[0] > stored.size() - from || sizes[1] > bytes.size() - to)
      throw_spz_error(path, fmt::format("frame {} of {} is longer than its header allows", i + 1,
                                        header.frames));
    const size_t unpacked =
        ZSTD_decompress(bytes.data() + to, sizes[1], stored.data() + from, sizes[0]);
    if (unpacked != sizes[1])  // or an error code, which is larger than any size
      throw_spz_error(path, fmt::format("frame {} of {} is damaged", i + 1, header.frames));
    from += sizes[0];
    to += sizes[1];
  }
  bytes.resize(to);
  return bytes;
}

}  // namespace

PlyTable read_spz(const std::string& path) {
  require_file(path);
  const size_t stored = std::filesystem::file_size(path);
  Bytes bytes = read_file_or_gzip(path, [&](const Bytes& beginning) {
    const SpzHeader header = read_header(beginning, path);
    require_plausible_count(header, stored, path);
    return sizeof header + header.count * bytes_each(header) + kMostBehind;
  });
  const SpzHeader header = read_header(bytes, path);
  if (header.version == 4) bytes = unpack_frames(bytes, path);
  const size_t n = header.count, coefficients = coefficients_of(header);
  const size_t quat_bytes = quat_bytes_of(header), each = bytes_each(header);
  if ((bytes.size() - sizeof header) / each < n)
    throw_spz_error(
        path, fmt::format("it is truncated: {} Gaussians need {} bytes, {} follow the header", n,
                          n * each, bytes.size() - sizeof header));
  const uint8_t* positions = bytes.data() + sizeof header;
  const uint8_t* opacities = positions + 9 * n;
  const uint8_t* colors = opacities + n;
  const uint8_t* scales = colors + 3 * n;
  const uint8_t* quats = scales + 3 * n;
  const uint8_t* harmonics = quats + quat_bytes * n;

  SplatTable table(n, header.sh_degree, Normals::none);
  for (size_t i = 0; i < n; ++i) {
    const SplatRow row = table.row(i);
    for (size_t k = 0; k < 3; ++k) {
      const double p = fixed24(positions + 9 * i + 3 * k, header.fraction_bits);
      row.mean[k] = float(k == 0 ? p : 0 - p);
      row.log_scales[k] = float(scales[3 * i + k]) / 16 - 10;
      row.sh0[k] = float((colors[3 * i + k] / 255.0 - 0.5) / 0.15);
      for (size_t c = 0; c < coefficients; ++c)
        row.sh_rest[k * coefficients + c] =
            kTurned[c] * (float(harmonics[3 * (i * coefficients + c) + k]) / 128 - 1);
    }
    *row.logit_opacity = logit_of_opacity(opacities[i] / 255.0);
    const auto q = unpack_quat(quats + quat_bytes * i, header.version);
    row.quat[0] = float(q[3]);
    row.quat[1] = float(q[0]);
    row.quat[2] = -float(q[1]);
    row.quat[3] = -float(q[2]);
  }
  if (header.flags & kAntialiased) table.table.comments = {antialiased_comment};
  return std::move(table.table);
}

}  // namespace gflow
