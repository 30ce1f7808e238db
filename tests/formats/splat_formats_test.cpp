// SPDX-License-Identifier: Apache-2.0
// Files of other programs are packed here from known Gaussians by the formats' descriptions;
// reading must return these within half a quantisation step.
#include <zstd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>
#include <random>

#include "optim/formats/compressed_ply.hpp"
#include "optim/formats/dot_splat.hpp"
#include "optim/formats/splat_table.hpp"
#include "optim/formats/spz.hpp"
#include "runtime/files/atomic_file.hpp"
#include "tests/support/memory_of.hpp"
#include "tests/support/temporary_folder.hpp"

namespace gflow {
namespace {

// Gaussians with unit quaternions, w > 0; colours and opacities well inside [0, 1].
SplatTable random_splats(size_t count, int sh_degree) {
  std::mt19937 rng(3);
  const auto uniform = [&](float low, float high) {
    return low + (high - low) * float(rng()) / 4294967296.f;
  };
  SplatTable table(count, sh_degree, Normals::none);
  for (size_t i = 0; i < count; ++i) {
    const SplatRow row = table.row(i);
    for (size_t k = 0; k < 3; ++k) {
      row.mean[k] = uniform(-5, 3);
      row.log_scales[k] = uniform(-7, -1);
      row.sh0[k] = uniform(-1.5f, 1.5f);
    }
    *row.logit_opacity = uniform(-3, 3);
    for (size_t k = 0; k < table.rest; ++k) row.sh_rest[k] = uniform(-0.9f, 0.9f);
    float norm = 0;
    for (size_t k = 0; k < 4; ++k) {
      row.quat[k] = uniform(-1, 1);
      norm += row.quat[k] * row.quat[k];
    }
    for (size_t k = 0; k < 4; ++k)
      row.quat[k] *= (row.quat[0] < 0 && k == 0 ? -1.f : 1.f) / std::sqrt(norm);
  }
  return table;
}

struct Tolerance {
  double mean, log_scale, quat, color, opacity, sh;
};

std::vector<std::string> without_normals(std::vector<std::string> names) {
  names.erase(std::remove_if(names.begin(), names.end(),
                             [](const std::string& n) { return n.size() == 2 && n[0] == 'n'; }),
              names.end());
  return names;
}

// Equal to the tolerance in each quantity; quaternions up to their sign and length.
void expect_near(SplatTable& expected, PlyTable read, const Tolerance& tolerance) {
  ASSERT_EQ(read.rows, expected.table.rows);
  SplatTable got = standard_table(read, "test");
  ASSERT_EQ(without_normals(read.names), without_normals(expected.table.names));
  for (size_t i = 0; i < read.rows; ++i) {
    const SplatRow a = expected.row(i), b = got.row(i);
    double dot = 0, norms = 0, norm_a = 0;
    for (size_t k = 0; k < 3; ++k) {
      ASSERT_NEAR(a.mean[k], b.mean[k], tolerance.mean) << i;
      ASSERT_NEAR(a.log_scales[k], b.log_scales[k], tolerance.log_scale) << i;
      ASSERT_NEAR(color_of_sh0(a.sh0[k]), color_of_sh0(b.sh0[k]), tolerance.color) << i;
    }
    for (size_t k = 0; k < 4; ++k) {
      dot += double(a.quat[k]) * b.quat[k];
      norms += double(b.quat[k]) * b.quat[k];
      norm_a += double(a.quat[k]) * a.quat[k];
    }
    // |a - b|^2 = 2 - 2 a.b
    ASSERT_LT(2 - 2 * std::fabs(dot) / std::sqrt(norms * norm_a),
              4 * tolerance.quat * tolerance.quat)
        << i;
    ASSERT_NEAR(opacity_of_logit(*a.logit_opacity), opacity_of_logit(*b.logit_opacity),
                tolerance.opacity)
        << i;
    for (size_t k = 0; k < expected.rest; ++k)
      ASSERT_NEAR(a.sh_rest[k], b.sh_rest[k], tolerance.sh) << i;
  }
}

template <class T>
void append(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

// --- PLY

// exp(-Inf) = 0 is a flat Gaussian, sigmoid(Inf) = 1 an opaque one and sigmoid(-Inf) = 0 one that
// is never seen.
TEST(SplatPly, InfiniteLogitsAndFlatScalesBecomeFinite) {
  const TemporaryFolder folder;
  SplatTable table = random_splats(3, 0);
  const float infinite = std::numeric_limits<float>::infinity();
  *table.row(0).logit_opacity = infinite;
  *table.row(1).logit_opacity = -infinite;
  table.row(2).log_scales[1] = -infinite;
  write_ply(folder.file("a.ply"), table.table);
  SplatTable back = standard_table(read_splats(folder.file("a.ply")), "a.ply");
  ASSERT_EQ(back.table.rows, 3u);
  EXPECT_NEAR(opacity_of_logit(*back.row(0).logit_opacity), 1, 1e-5);
  EXPECT_NEAR(opacity_of_logit(*back.row(1).logit_opacity), 0, 1e-5);
  EXPECT_LT(std::exp(back.row(2).log_scales[1]), 1e-37f);
  for (const float value : back.table.values) EXPECT_TRUE(std::isfinite(value));
  EXPECT_EQ(back.row(2).log_scales[0], table.row(2).log_scales[0]);
  EXPECT_EQ(*back.row(2).logit_opacity, *table.row(2).logit_opacity);
}

TEST(SplatPly, GaussiansThatCannotBeDrawnAreLeftOutWithOneWarning) {
  const TemporaryFolder folder;
  SplatTable table = random_splats(6, 1);
  const float infinite = std::numeric_limits<float>::infinity();
  table.row(1).mean[1] = std::nanf("");
  table.row(2).log_scales[0] = infinite;
  table.row(3).sh_rest[4] = -infinite;
  std::fill_n(table.row(5).quat, 4, 0.f);
  const std::string path = folder.file("a.ply");
  write_ply(path, table.table);
  testing::internal::CaptureStderr();
  PlyTable read = read_splats(path);
  read_splats(path);
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            fmt::format("gflow: warning: 4 of the 6 Gaussians in {} cannot be drawn and are left "
                        "out; the first is Gaussian 1, which has NaN or Inf in y\n",
                        path));
  expect_error([&] { read_splats(path, Undrawable::refused); },
               {"cannot read " + path, "4 of its 6 Gaussians cannot be drawn", "Gaussian 1"});
  ASSERT_EQ(read.rows, 2u);
  EXPECT_EQ(read.values.size(), 2 * read.names.size());
  SplatTable kept = standard_table(read, path);
  EXPECT_EQ(kept.row(0).mean[0], table.row(0).mean[0]);
  EXPECT_EQ(kept.row(1).mean[0], table.row(4).mean[0]);
  EXPECT_EQ(kept.row(1).quat[3], table.row(4).quat[3]);
}

TEST(SplatPly, AFileWithoutAnyGaussianThatCanBeDrawnIsRefused) {
  const TemporaryFolder folder;
  SplatTable table = random_splats(3, 0);
  for (size_t i = 0; i < 3; ++i) std::fill_n(table.row(i).quat, 4, 0.f);
  write_ply(folder.file("a.ply"), table.table);
  expect_error([&] { read_splats(folder.file("a.ply")); },
               {"a.ply", "3 of its 3 Gaussians", "Gaussian 0, which has the rotation 0 0 0 0"});
}

TEST(SplatPly, ColumnsThatAreNotDrawnMayHaveAnyValue) {
  const TemporaryFolder folder;
  SplatTable one = random_splats(1, 0);
  PlyTable table = one.table;
  table.names.insert(table.names.end(), {"nx", "confidence"});
  table.values.insert(table.values.end(), {std::nanf(""), std::nanf("")});
  write_ply(folder.file("a.ply"), table);
  EXPECT_EQ(read_splats(folder.file("a.ply")).rows, 1u);
}

// --- .splat

const Tolerance kDotSplat{0, 1e-6, 2.0 / 128, 0.51 / 255, 0.51 / 255, 0};

TEST(DotSplat, ComesBackToThePrecisionOfItsBytesLargestFirst) {
  const TemporaryFolder folder;
  SplatTable table = random_splats(50, 0);
  write_dot_splat(folder.file("a.splat"), table.table);
  EXPECT_EQ(contents(folder.file("a.splat")).size(), 50u * 32);
  SplatTable back = standard_table(read_dot_splat(folder.file("a.splat")), "a.splat");
  double before = 1e9;
  for (size_t i = 0; i < 50; ++i) {
    const SplatRow row = back.row(i);
    const double weight = std::exp(row.log_scales[0] + row.log_scales[1] + row.log_scales[2]) *
                          opacity_of_logit(*row.logit_opacity);
    EXPECT_LT(weight, before * 1.02);  // opacities are rounded
    before = weight;
    for (size_t j = 0; j < 50; ++j) {  // replaced by its original, found by position
      const SplatRow original = table.row(j);
      if (original.mean[0] != row.mean[0] || j == i) continue;
      for (size_t c = 0; c < table.table.names.size(); ++c)
        std::swap(table.table.values[i * table.table.names.size() + c],
                  table.table.values[j * table.table.names.size() + c]);
    }
  }
  expect_near(table, back.table, kDotSplat);
}

TEST(DotSplat, WrittenAgainIsTheSameFile) {
  const TemporaryFolder folder;
  write_dot_splat(folder.file("a.splat"), random_splats(50, 1).table);
  write_dot_splat(folder.file("b.splat"), read_dot_splat(folder.file("a.splat")));
  SplatTable a = standard_table(read_dot_splat(folder.file("a.splat")), "a");
  expect_near(a, read_dot_splat(folder.file("b.splat")), kDotSplat);
}

// 32 bytes by hand: a half-transparent red Gaussian of scales 1, e, 1, rotated by 90 degrees about
// z.
TEST(DotSplat, BytesMeanWhatTheFormatSays) {
  const TemporaryFolder folder;
  std::string bytes;
  for (const float value : {1.f, 2.f, 3.f, 1.f, 2.7182818f, 1.f}) append(bytes, value);
  for (const int value : {255, 0, 0, 128, 218, 128, 128, 218}) append(bytes, uint8_t(value));
  SplatTable table = standard_table(read_splats(folder.write("a.splat", bytes)), "a");
  const SplatRow row = table.row(0);
  EXPECT_EQ(row.mean[2], 3);
  EXPECT_NEAR(row.log_scales[1], 1, 1e-6);
  EXPECT_NEAR(color_of_sh0(row.sh0[0]), 1, 1e-6);
  EXPECT_NEAR(color_of_sh0(row.sh0[1]), 0, 1e-6);
  EXPECT_NEAR(opacity_of_logit(*row.logit_opacity), 128.0 / 255, 1e-6);
  EXPECT_EQ(row.quat[0], row.quat[3]);
  EXPECT_EQ(row.quat[1], 0);
}

// A Gaussian takes 32 bytes in the file and 14 floats in memory, and nothing else is allocated.
TEST(DotSplat, ReadingTakesTheMemoryOfWhatIsMadeOfIt) {
  const TemporaryFolder folder;
  constexpr size_t n = 1000000;
  const std::string path = folder.write("a.splat", std::string(32 * n, '\1'));
  EXPECT_LT(memory_of([&] { EXPECT_EQ(read_splats(path).rows, n); }),
            double(n) * 56 / (1 << 20) + 8);
}

// Allocates the output and the sort order, but no copy of the table.
TEST(DotSplat, WritingTakesTheMemoryOfTheFileAndItsOrder) {
  const TemporaryFolder folder;
  constexpr size_t n = 1000000;
  const SplatTable table(n, 1);
  EXPECT_LT(memory_of([&] { write_dot_splat(folder.file("a.splat"), table.table); }),
            double(n) * (32 + 8 + 4 + 4) / (1 << 20) + 8);
}

TEST(DotSplat, OpaqueAndEmptyGaussiansHaveFiniteLogits) {
  const TemporaryFolder folder;
  std::string bytes;
  for (const int opacity : {0, 255}) {
    for (const float value : {0.f, 0.f, 0.f, 1.f, 1.f, 0.f}) append(bytes, value);
    for (const int value : {0, 0, 0, opacity, 255, 128, 128, 128}) append(bytes, uint8_t(value));
  }
  for (const float value : read_splats(folder.write("a.splat", bytes)).values)
    EXPECT_TRUE(std::isfinite(value));
}

TEST(DotSplat, RefusesWhatIsNoSuchFile) {
  const TemporaryFolder folder;
  expect_error([&] { read_splats(folder.write("a.splat", std::string(33, '\0'))); },
               {"a.splat", "32 bytes", "33"});
  std::string bytes;
  for (const float value : {0.f, 0.f, 0.f, 1.f, -1.f, 1.f}) append(bytes, value);
  expect_error([&] { read_splats(folder.write("b.splat", bytes + std::string(8, '\x40'))); },
               {"b.splat", "Gaussian 0", "-1"});
  bytes.replace(0, 4, "\xff\xff\xff\xff");
  bytes[19] = 0x3f;
  expect_error([&] { read_splats(folder.write("c.splat", bytes + std::string(8, '\x40'))); },
               {"c.splat", "Gaussian 0", "NaN or Inf"});
}

TEST(DotSplat, GaussiansThatCannotBeDrawnAreLeftOut) {
  const TemporaryFolder folder;
  std::string bytes;
  const auto add = [&](float x, float scale, int w) {
    for (const float value : {x, 0.f, 0.f, scale, 1.f, 1.f}) append(bytes, value);
    for (const int value : {0, 0, 0, 255, w, 128, 128, 128}) append(bytes, uint8_t(value));
  };
  add(std::nanf(""), 1, 255);
  add(1, std::nanf(""), 255);
  add(2, std::numeric_limits<float>::infinity(), 255);
  add(3, 1, 128);  // no rotation
  add(4, 1, 255);
  const PlyTable read = read_splats(folder.write("a.splat", bytes));
  EXPECT_EQ(read.column_values("x"), std::vector<float>{4});
}

TEST(DotSplat, RefusesAFileThatBecomesShorterWhileItIsRead) {
  const TemporaryFolder folder;
  SplatTable table = random_splats(20000, 0);  // several pieces
  write_dot_splat(folder.file("a.splat"), table.table);
  for (const size_t left : {32u * 12000u, 32u * 12000u + 5u, 0u}) {
    const std::string path = folder.write("b.splat", contents(folder.file("a.splat")));
    FilePieces file(path);
    std::filesystem::resize_file(path, left);
    SCOPED_TRACE(left);
    expect_error([&] { read_dot_splat(file); }, {"b.splat", "truncated while being read"});
  }
}

// --- compressed PLY

uint32_t unorm(double value, int bits) {
  return uint32_t(std::lround(value * double((1u << bits) - 1)));
}

uint32_t pack_11_10_11(const double* at) {
  return unorm(at[0], 11) << 21 | unorm(at[1], 10) << 11 | unorm(at[2], 11);
}

// 2 bits for the index of the largest component, 10 for each other in order.
uint32_t pack_quat(const float* quat) {
  size_t largest = 0;
  for (size_t k = 1; k < 4; ++k)
    if (std::fabs(quat[k]) > std::fabs(quat[largest])) largest = k;
  const double sign = quat[largest] < 0 ? -1 : 1;
  uint32_t word = uint32_t(largest);
  for (size_t k = 0; k < 4; ++k)
    if (k != largest) word = word << 10 | unorm(sign * quat[k] / std::sqrt(2.0) + 0.5, 10);
  return word;
}

struct CompressedPly {
  bool color_ranges = true;
  int chunks_missing = 0;
  size_t sh_rows_missing = 0;

  std::string bytes(SplatTable& table) const {
    const size_t n = table.table.rows, chunks = (n + 255) / 256 - size_t(chunks_missing);
    std::string out =
        "ply\nformat binary_little_endian 1.0\nelement chunk " + std::to_string(chunks) + "\n";
    for (const std::string kind : {"", "scale_"})
      for (const std::string end : {"min_", "max_"})
        for (const char* axis : {"x", "y", "z"})
          out += "property float " + end + kind + axis + "\n";
    if (color_ranges)
      for (const std::string end : {"min_", "max_"})
        for (const char* channel : {"r", "g", "b"}) out += "property float " + end + channel + "\n";
    out += "element vertex " + std::to_string(n) + "\n";
    for (const char* name : {"position", "rotation", "scale", "color"})
      out += std::string("property uint packed_") + name + "\n";
    if (table.rest) {
      out += "element sh " + std::to_string(n - sh_rows_missing) + "\n";
      for (size_t k = 0; k < table.rest; ++k)
        out += "property uchar f_rest_" + std::to_string(k) + "\n";
    }
    out += "end_header\n";
    // The ranges differ from chunk to chunk.
    const auto low = [](size_t i, double base) { return float(base - 0.25 * double(i / 256)); };
    for (size_t c = 0; c < chunks; ++c) {
      for (const double base : {-5.0, 3.0, -7.0, 0.0})
        for (int k = 0; k < 3; ++k)
          append(out, base == 3 || base == 0 ? float(base) : low(256 * c, base));
      if (color_ranges)
        for (const float base : {-0.5f, -0.5f, -0.5f, 1.5f, 1.5f, 1.5f}) append(out, base);
    }
    for (size_t i = 0; i < n; ++i) {
      const SplatRow row = table.row(i);
      double where[3], size[3];
      uint32_t rgba = 0;
      for (size_t k = 0; k < 3; ++k) {
        where[k] = (row.mean[k] - low(i, -5)) / (3 - low(i, -5));
        size[k] = (row.log_scales[k] - low(i, -7)) / (0 - low(i, -7));
        const double level = color_of_sh0(row.sh0[k]);
        rgba = rgba << 8 | unorm(color_ranges ? (level + 0.5) / 2 : level, 8);
      }
      append(out, pack_11_10_11(where));
      append(out, pack_quat(row.quat));
      append(out, pack_11_10_11(size));
      append(out, rgba << 8 | unorm(opacity_of_logit(*row.logit_opacity), 8));
    }
    for (size_t i = 0; i < n - sh_rows_missing; ++i)
      for (size_t k = 0; k < table.rest; ++k)
        append(out, uint8_t((table.row(i).sh_rest[k] / 8 + 0.5) * 256));
    return out;
  }
};

// Half a step: 8.25/1023 in y; 7.25/1023; sqrt 2/1023, amplified for the largest component.
const Tolerance kCompressed{4.2e-3, 3.7e-3, 2.5e-3, 4e-3, 2e-3, 4.1 / 256};

TEST(CompressedPly, IsReadToThePrecisionOfItsBits) {
  const TemporaryFolder folder;
  for (const int degree : {0, 1, 3})
    for (const bool color_ranges : {true, false}) {
      SplatTable table = random_splats(300, degree);  // two chunks, the second not full
      const std::string path = folder.write("a.ply", CompressedPly{color_ranges}.bytes(table));
      EXPECT_EQ(splat_format(path), SplatFormat::compressed_ply);
      expect_near(table, read_splats(path), kCompressed);
    }
}

TEST(CompressedPly, RefusesWhatDoesNotFitTogether) {
  const TemporaryFolder folder;
  SplatTable table = random_splats(300, 1);
  expect_error(
      [&] {
        read_splats(folder.write("a.ply", CompressedPly{true, 1}.bytes(table)));
      },
      {"a.ply", "300 Gaussians", "2 chunks of 256", "it has 1"});
  expect_error(
      [&] {
        read_splats(folder.write("b.ply", CompressedPly{true, 0, 1}.bytes(table)));
      },
      {"b.ply", "299 of 300"});
  std::string bytes = CompressedPly{}.bytes(table);
  const std::vector<std::pair<std::string, int>> sizes = {
      {"uchar", 1}, {"ushort", 2}, {"float", 4}, {"double", 8}};
  for (const auto& [type, size] : sizes) {
    std::string other = bytes;
    const std::string property = "uint packed_scale";
    other.replace(other.find(property), 4, type);
    other.resize(
        size_t(long(other.size()) + (size - 4) * long(table.table.rows)));  // the stated length
    expect_error([&] { read_splats(folder.write("d.ply", other)); },
                 {"d.ply", "'packed_scale' is not a uint"});
  }
  expect_error([&] { read_splats(folder.write("c.ply", bytes.substr(0, bytes.size() - 20))); },
               {"c.ply", "truncated", "300 rows of sh"});
  bytes.replace(bytes.find("element vertex 300"), 18, "element vertex 9999999999");
  expect_error([&] { read_splats(folder.write("d.ply", bytes)); }, {"d.ply", "truncated"});
}

// Its words and one table, not two.
TEST(CompressedPly, ReadingTakesTheMemoryOfWhatIsMadeOfIt) {
  const TemporaryFolder folder;
  constexpr size_t n = 150000;
  SplatTable table = random_splats(n, 3);
  const std::string path = folder.write("a.ply", CompressedPly{}.bytes(table));
  table = SplatTable(0, 0);
  const double mib = double(n) * (4 * (45 + 4) + 4 * 59) / (1 << 20);
  EXPECT_LT(memory_of([&] { EXPECT_EQ(read_splats(path).rows, n); }), mib + 8);
}

// The range of a chunk makes all its Gaussians.
TEST(CompressedPly, ARangeThatIsNotFiniteLosesItsChunk) {
  const TemporaryFolder folder;
  SplatTable table = random_splats(10, 0);
  std::string bytes = CompressedPly{}.bytes(table);
  const size_t first = bytes.find("end_header\n") + 11;
  bytes.replace(first, 4, "\xff\xff\xff\xff");
  expect_error([&] { read_splats(folder.write("a.ply", bytes)); },
               {"a.ply", "10 of its 10", "Gaussian 0", "NaN or Inf"});
  table = random_splats(300, 0);
  bytes = CompressedPly{}.bytes(table);
  bytes.replace(bytes.find("end_header\n") + 11, 4, "\xff\xff\xff\xff");
  EXPECT_EQ(read_splats(folder.write("b.ply", bytes)).rows, 300u - 256);
}

// --- .spz

struct Spz {
  uint32_t version;
  uint8_t flags = 0;

  std::string bytes(SplatTable& table) const {
    const auto attributes = attributes_of(table);
    std::string out = "NGSP";
    append(out, version);
    append(out, uint32_t(table.table.rows));
    const int degree = sh_degree_of(table.rest), frames = version < 4 ? 0 : int(attributes.size());
    for (const int value : {degree, 12, int(flags), frames}) append(out, uint8_t(value));
    if (version == 4) return out + in_frames(attributes);
    for (const std::string& attribute : attributes) out += attribute;
    return out;
  }

  // What follows the first 16 bytes in version 4. Extensions are between the header and the table.
  static std::string in_frames(const std::vector<std::string>& attributes) {
    const std::string extension = "8 bytes.";
    std::string table, frames;
    for (const std::string& attribute : attributes) {
      std::string frame(ZSTD_compressBound(attribute.size()), '\0');
      frame.resize(
          ZSTD_compress(frame.data(), frame.size(), attribute.data(), attribute.size(), 3));
      append(table, uint64_t(frame.size()));
      append(table, uint64_t(attribute.size()));
      frames += frame;
    }
    std::string out;
    append(out, uint32_t(32 + extension.size()));
    return out + std::string(12, '\0') + extension + table + frames;
  }

  // Without those that are empty.
  std::vector<std::string> attributes_of(SplatTable& table) const {
    const size_t n = table.table.rows, coefficients = table.rest / 3;
    std::vector<std::string> attributes(coefficients ? 6 : 5);
    for (size_t i = 0; i < n; ++i)
      for (size_t k = 0; k < 3; ++k) {  // y and z are flipped
        const int32_t fixed = int32_t(std::lround(table.row(i).mean[k] * (k ? -4096.f : 4096.f)));
        attributes[0].append(reinterpret_cast<const char*>(&fixed), 3);
      }
    for (size_t i = 0; i < n; ++i)
      append(attributes[1], uint8_t(unorm(opacity_of_logit(*table.row(i).logit_opacity), 8)));
    for (size_t i = 0; i < n; ++i)
      for (size_t k = 0; k < 3; ++k)
        append(attributes[2], uint8_t(unorm(0.15 * table.row(i).sh0[k] + 0.5, 8)));
    for (size_t i = 0; i < n; ++i)
      for (size_t k = 0; k < 3; ++k)
        append(attributes[3], uint8_t(std::lround(16 * (table.row(i).log_scales[k] + 10))));
    for (size_t i = 0; i < n; ++i) append_quat(attributes[4], table.row(i).quat);
    for (size_t i = 0; i < n; ++i)
      for (size_t c = 0; c < coefficients; ++c)
        for (size_t k = 0; k < 3; ++k)
          append(attributes[5],
                 uint8_t(std::lround(128 +
                                     128 * sign(c) * table.row(i).sh_rest[k * coefficients + c])));
    return attributes;
  }

  // Sign of a coefficient after the flip: its polynomial's number of factors y and z.
  static float sign(size_t c) {
    const int factors[15] = {1, 1, 0, 1, 2, 0, 1, 0, 1, 2, 1, 1, 0, 1, 0};
    return factors[c] % 2 ? -1.f : 1.f;
  }

  void append_quat(std::string& out, const float* wxyz) const {
    double q[4] = {wxyz[1], -wxyz[2], -wxyz[3], wxyz[0]};  // x y z w
    if (version == 2) {
      for (size_t k = 0; k < 3; ++k) append(out, uint8_t(std::lround(127.5 * (q[k] + 1))));
      return;
    }
    size_t largest = 0;
    for (size_t k = 1; k < 4; ++k)
      if (std::fabs(q[k]) > std::fabs(q[largest])) largest = k;
    uint32_t word = uint32_t(largest);
    for (size_t k = 0; k < 4; ++k) {
      if (k == largest) continue;
      const bool negative = (q[k] < 0) != (q[largest] < 0);
      word = word << 10 | uint32_t(negative) << 9 |
             uint32_t(std::lround(511 * std::fabs(q[k]) * std::sqrt(2.0)));
    }
    append(out, word);
  }
};

TEST(Spz, IsReadToThePrecisionOfItsBytesAndTurned) {
  const TemporaryFolder folder;
  for (const uint32_t version : {2u, 3u, 4u})
    for (const int degree : {0, 1, 2, 3}) {
      SplatTable table = random_splats(40, degree);
      const std::string bytes = Spz{version}.bytes(table);
      // Where w is small, version 2 derives it from the others only to the square root of their
      // step.
      const Tolerance tolerance{1.3e-4, 0.032, version == 2 ? 0.07 : 2e-3, 4e-3, 2e-3, 4.1e-3};
      expect_near(table, read_splats(folder.write("a.spz", bytes)), tolerance);
      if (version == 4) continue;
      write_file_atomically(folder.file("b.spz"), gzip(bytes));
      EXPECT_EQ(read_splats(folder.file("b.spz")).values, read_splats(folder.file("a.spz")).values);
    }
}

TEST(Spz, RefusesOtherVersionsAndTruncatedOnes) {
  const TemporaryFolder folder;
  SplatTable table = random_splats(4, 1);
  const std::string bytes = Spz{3}.bytes(table);
  expect_error([&] { read_splats(folder.write("a.spz", bytes.substr(0, bytes.size() - 1))); },
               {"a.spz", "truncated", "4 Gaussians"});
  expect_error([&] { read_splats(folder.write("b.spz", bytes.substr(0, 9))); },
               {"b.spz", "truncated"});
  expect_error([&] { read_splats(folder.write("c.spz", Spz{5}.bytes(table))); },
               {"c.spz", "version 5", "2 to 4", "as a PLY"});
  std::string huge = bytes;
  huge.replace(8, 4, "\xff\xff\xff\xff");
  expect_error([&] { read_splats(folder.write("d.spz", huge)); }, {"d.spz", "4294967295"});
  std::string shifted = bytes;
  shifted[13] = 25;
  expect_error([&] { read_splats(folder.write("g.spz", shifted)); },
               {"g.spz", "25 fractional bits", "24 bits in total"});
  const Bytes packed = gzip(bytes);
  expect_error(
      [&] {
        read_splats(folder.write("h.spz", std::string(packed.begin(), packed.end()) + "abc"));
      },
      {"h.spz", "3 bytes follow the end of its gzip stream"});
  // A million Gaussians of zeros, compressed to a thousandth of their memory.
  std::string bomb = bytes.substr(0, 16) + std::string(20000000, '\0');
  const uint32_t million = 1000000;
  std::memcpy(&bomb[8], &million, sizeof million);
  write_file_atomically(folder.file("e.spz"), gzip(bomb));
  expect_error([&] { read_splats(folder.file("e.spz")); }, {"e.spz", "would decompress to"});
  const uint32_t thousand = 1000;  // this many are accepted
  std::memcpy(&bomb[8], &thousand, sizeof thousand);
  write_file_atomically(folder.file("f.spz"), gzip(bomb.substr(0, 100000)));
  EXPECT_EQ(read_splats(folder.file("f.spz")).rows, thousand);
}

TEST(Spz, RefusesDamagedFrames) {
  const TemporaryFolder folder;
  SplatTable table = random_splats(40, 0);
  const std::string bytes = Spz{4}.bytes(table);
  const auto with = [&](size_t at, auto value) {
    std::string other = bytes;
    std::memcpy(&other[at], &value, sizeof value);
    return folder.write("a.spz", other);
  };
  constexpr size_t entries = 40, entry = 16;  // behind header and extension
  for (const size_t length : {size_t{20}, entries + 5 * entry - 1})
    expect_error([&] { read_splats(folder.write("a.spz", bytes.substr(0, length))); },
                 {"a.spz", "truncated", "table of frames"});
  for (const uint32_t table_at : {0u, 31u, 0xffffffffu})
    expect_error([&] { read_splats(with(16, table_at)); }, {"a.spz", "table of frames"});
  for (const size_t half : {0, 8})
    for (const uint64_t size : {uint64_t(bytes.size()), ~uint64_t{0}})
      expect_error([&] { read_splats(with(entries + entry + half, size)); },
                   {"a.spz", "frame 2 of 5"});
  expect_error([&] { read_splats(with(entries + 5 * entry + 6, ~uint32_t{0})); },
               {"a.spz", "frame 1 of 5"});
  expect_error([&] { read_splats(with(entries + 8, uint64_t{359})); }, {"a.spz", "frame 1 of 5"});
  expect_error([&] { read_splats(with(15, uint8_t{4})); }, {"a.spz"});
  expect_error([&] { read_splats(with(8, uint32_t{41})); }, {"a.spz", "truncated", "41 Gaussians"});
  expect_error([&] { read_splats(with(8, ~uint32_t{0})); }, {"a.spz", "would decompress to"});
}

// --- any format

// Bit 0 of the flags in an .spz, a comment elsewhere.
TEST(SplatFormats, TrainingWithAntialiasingIsReportedAndKept) {
  const TemporaryFolder folder;
  SplatTable table = random_splats(4, 0);
  std::string packed = CompressedPly{}.bytes(table);
  packed.insert(packed.find("element"), "comment SplatRenderMode: mip\n");
  PlyTable plain = table.table;
  plain.comments = {"made by hand", "antialiased 1"};
  write_ply(folder.file("a.ply"), plain);
  for (const std::string& path : {folder.file("a.ply"), folder.write("b.ply", packed),
                                  folder.write("c.spz", Spz{3, 1}.bytes(table))}) {
    testing::internal::CaptureStderr();
    const PlyTable read = read_splats(path);
    EXPECT_NE(testing::internal::GetCapturedStderr().find(
                  path + ": its Gaussians were trained with antialiasing"),
              std::string::npos);
    EXPECT_EQ(StandardRows(read, path).head().comments,
              std::vector<std::string>{"SplatRenderMode: mip"});
  }
  EXPECT_TRUE(read_splats(folder.write("d.spz", Spz{3, 2}.bytes(table))).comments.empty());
}

TEST(SplatFormats, AreKnownByTheirFirstBytes) {
  const TemporaryFolder folder;
  SplatTable table = random_splats(3, 0);
  write_ply(folder.file("a"), table.table);
  EXPECT_EQ(splat_format(folder.file("a")), SplatFormat::ply);
  EXPECT_EQ(splat_format(folder.write("b", Spz{2}.bytes(table))), SplatFormat::spz);
  write_dot_splat(folder.file("c.SPLAT"), table.table);
  EXPECT_EQ(splat_format(folder.file("c.SPLAT")), SplatFormat::splat);
  expect_error([&] { splat_format(folder.write("d.ksplat", "what is this?")); },
               {"d.ksplat", ".splat, .spz"});
  expect_error([&] { splat_format(folder.file("missing")); }, {"missing"});
}

// Bundled .sog files are zip archives, but unpacking them does not help.
TEST(SplatFormats, AnArchiveMustBeUnpacked) {
  const TemporaryFolder folder;
  for (const char* name : {"scene.zip", "scene"})
    expect_error([&] { splat_format(folder.write(name, "PK\x03\x04 and more")); },
                 {name, "zip archive; unpack it first"});
  expect_error([&] { splat_format(folder.write("a.sog", "PK\x03\x04 and more")); },
               {"a.sog", "unknown splat format"});
}

TEST(SplatFormats, AStandardTableHasTheStandardsColumns) {
  PlyTable table = random_splats(3, 1).table;
  table.names.push_back("extra");
  table.values.resize(3 * table.names.size());
  EXPECT_EQ(standard_table(table, "x").table.names, SplatTable(3, 1).table.names);
  table.names[3] = "red";
  expect_error([&] { standard_table(table, "x.ply"); }, {"x.ply", "'f_dc_0' is missing"});
}

}  // namespace
}  // namespace gflow
