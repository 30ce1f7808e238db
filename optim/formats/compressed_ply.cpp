// SPDX-License-Identifier: Apache-2.0
// Packed words of a Gaussian, highest bits first (playcanvas/splat-transform, decompress-ply.ts):
//   packed_position  x 11, y 10, z 11 bits: 0 to 1 between the chunk's min and max
//   packed_scale     the same for the log scales
//   packed_rotation  2 bits: index of the largest of w x y z, which is omitted; 10 bits for each of
//                    the others, 0 to 1 for -1/sqrt 2 to 1/sqrt 2
//   packed_color     red, green, blue between the chunk's min and max if it has them; opacity
// Element "sh" has one byte for each f_rest_*, 0 to 1 for -4 to 4.
#include "optim/formats/compressed_ply.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>

#include "optim/formats/ply_rows.hpp"
#include "optim/formats/splat_dialects.hpp"
#include "optim/formats/splat_table.hpp"
#include "runtime/base/error.hpp"

namespace gflow {
namespace {

constexpr size_t kChunk = 256;

[[noreturn]] void refuse_compressed(const std::string& path, const std::string& why) {
  throw Error(fmt::format("cannot read compressed PLY {}: {}", path, why));
}

const PlyElement* find(const std::vector<PlyElement>& elements, std::string_view name) {
  for (const PlyElement& element : elements)
    if (element.name == name) return &element;
  return nullptr;
}

const PlyElement& required(const std::vector<PlyElement>& elements, std::string_view name,
                           const std::string& path) {
  const PlyElement* element = find(elements, name);
  if (!element) refuse_compressed(path, fmt::format("it has no element '{}'", name));
  return *element;
}

// A property by row. Error if the element has no property of that name.
class Column {
 public:
  Column(const PlyElement& element, const std::string& name, const std::string& path)
      : element_(element), at_(size_t(element.property(name))) {
    if (element.property(name) < 0)
      refuse_compressed(path,
                        fmt::format("its element '{}' has no property '{}'", element.name, name));
  }
  double operator[](size_t row) const { return element_.value(row, at_); }
  uint32_t word(size_t row) const { return element_.words[row * element_.properties.size() + at_]; }

 private:
  const PlyElement& element_;
  size_t at_;
};

// A column of packed words. Error if it is not a 32-bit integer.
Column packed(const PlyElement& element, const std::string& name, const std::string& path) {
  const Column column(element, name, path);
  if (!element.is_32_bit[size_t(element.property(name))])
    refuse_compressed(
        path, fmt::format("its property '{}' is not a uint, the type of packed values", name));
  return column;
}

// The ranges of three properties per chunk, for instance min_x to max_x, y and z.
struct Ranges {
  std::vector<Column> low, high;
  double at(size_t chunk, size_t axis, double share) const {
    return low[axis][chunk] * (1 - share) + high[axis][chunk] * share;
  }
};

Ranges ranges_of(const PlyElement& chunks, const std::array<const char*, 3>& names,
                 const std::string& path) {
  Ranges ranges;
  for (const char* name : names) {
    ranges.low.emplace_back(chunks, std::string("min_") + name, path);
    ranges.high.emplace_back(chunks, std::string("max_") + name, path);
  }
  return ranges;
}

// `bits` bits of a word above its lowest `shift` bits, scaled to [0, 1].
double share(uint32_t word, int shift, int bits) {
  const uint32_t most = (1u << bits) - 1;
  return double((word >> shift) & most) / double(most);
}

std::array<double, 3> shares_11_10_11(uint32_t word) {
  return {share(word, 21, 11), share(word, 11, 10), share(word, 0, 11)};
}

std::array<double, 4> unpack_quat(uint32_t word) {
  const size_t largest = word >> 30;
  std::array<double, 4> quat{};
  double rest = 1;
  int shift = 20;
  for (size_t i = 0; i < 4; ++i) {
    if (i == largest) continue;
    quat[i] = (share(word, shift, 10) - 0.5) * std::sqrt(2.0);
    rest -= quat[i] * quat[i];
    shift -= 10;
  }
  quat[largest] = std::sqrt(std::max(rest, 0.0));
  return quat;
}

// SH coefficient of a byte: the centre of its bin, or the end of the range for 0 and 255.
float unpack_sh(double byte) {
  const double at = byte <= 0 ? 0 : byte >= 255 ? 1 : (byte + 0.5) / 256;
  return float((at - 0.5) * 8);
}

// SH degree of the element "sh"; 0 if it is absent.
int degree_of(const PlyElement* sh, size_t gaussians, const std::string& path) {
  if (!sh) return 0;
  if (sh->rows != gaussians)
    refuse_compressed(path, fmt::format("it has spherical harmonics for {} of {} Gaussians",
                                        sh->rows, gaussians));
  const int degree = sh_degree_of(sh->properties.size());
  if (degree < 0)
    refuse_compressed(path, fmt::format("its element 'sh' has {} properties, expected 9, 24 or 45",
                                        sh->properties.size()));
  return degree;
}

}  // namespace

bool is_compressed(const std::vector<std::string>& names) {
  return std::find(names.begin(), names.end(), "packed_position") != names.end();
}

PlyTable read_compressed_ply(const std::string& path) {
  const std::vector<PlyElement> elements = read_ply_elements(path);
  const PlyElement& vertices = required(elements, "vertex", path);
  const PlyElement& chunks = required(elements, "chunk", path);
  const PlyElement* sh = find(elements, "sh");
  const size_t needed = (vertices.rows + kChunk - 1) / kChunk;
  if (chunks.rows != needed)
    refuse_compressed(path, fmt::format("its {} Gaussians need {} chunks of {}, but it has {}",
                                        vertices.rows, needed, kChunk, chunks.rows));
  const Column position = packed(vertices, "packed_position", path);
  const Column scale = packed(vertices, "packed_scale", path);
  const Column rotation = packed(vertices, "packed_rotation", path);
  const Column color = packed(vertices, "packed_color", path);
  const Ranges positions = ranges_of(chunks, {"x", "y", "z"}, path);
  const Ranges scales = ranges_of(chunks, {"scale_x", "scale_y", "scale_z"}, path);
  const bool ranged_colors = chunks.property("min_r") >= 0;
  const Ranges colors = ranged_colors ? ranges_of(chunks, {"r", "g", "b"}, path) : Ranges{};

  SplatTable table(vertices.rows, degree_of(sh, vertices.rows, path), Normals::none);
  std::vector<Column> rest;
  for (size_t k = 0; k < table.rest; ++k)
    rest.emplace_back(*sh, "f_rest_" + std::to_string(k), path);
  for (size_t i = 0; i < vertices.rows; ++i) {
    const size_t chunk = i / kChunk;
    const auto where = shares_11_10_11(position.word(i));
    const auto size = shares_11_10_11(scale.word(i));
    const auto quat = unpack_quat(rotation.word(i));
    const uint32_t rgba = color.word(i);
    SplatRow row = table.row(i);
    for (size_t k = 0; k < 3; ++k) {
      const double level = share(rgba, 24 - 8 * int(k), 8);
      row.mean[k] = float(positions.at(chunk, k, where[k]));
      row.log_scales[k] = float(scales.at(chunk, k, size[k]));
      row.sh0[k] = sh0_of_color(ranged_colors ? colors.at(chunk, k, level) : level);
    }
    for (size_t k = 0; k < 4; ++k) row.quat[k] = float(quat[k]);
    *row.logit_opacity = logit_of_opacity(share(rgba, 0, 8));
    for (size_t k = 0; k < table.rest; ++k) row.sh_rest[k] = unpack_sh(rest[k][i]);
  }
  if (is_antialiased(PlyRows(path).header().comments)) table.table.comments = {antialiased_comment};
  return std::move(table.table);
}

}  // namespace gflow
