// SPDX-License-Identifier: Apache-2.0
// Layout per Gaussian (antimatter15/splat, main.js): position 3 f32; scales 3 f32, not logarithms;
// red green blue opacity u8 of [0, 1] x 255; quaternion w x y z u8 as 128 + 128 q.
#include "optim/formats/dot_splat.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <numeric>

#include "optim/formats/splat_table.hpp"
#include "runtime/base/error.hpp"
#include "runtime/files/atomic_file.hpp"
#include "runtime/files/file_pieces.hpp"

namespace gflow {
namespace {

constexpr size_t kSize = 32;

uint8_t to_byte(double value) { return uint8_t(std::clamp(std::round(value), 0.0, 255.0)); }

// Log scales of a Gaussian. A scale of 0 is an underflow in the writer; NaN and Inf stay. A
// negative scale means that the file is something else.
void read_log_scales(const uint8_t* bytes, size_t i, const std::string& path, float* log_scales) {
  float scales[3];
  std::memcpy(scales, bytes, sizeof scales);
  for (size_t k = 0; k < 3; ++k) {
    if (scales[k] < 0)
      throw Error(fmt::format("cannot read {}: Gaussian {} has scale {}; is this a .splat file?",
                              path, i, scales[k]));
    log_scales[k] = log_of_scale(scales[k]);
  }
}

// log(volume x opacity).
double weight_of(const SplatRow& row) {
  return double(row.log_scales[0]) + row.log_scales[1] + row.log_scales[2] +
         std::log(opacity_of_logit(*row.logit_opacity));
}

// Indices by descending weight; ties keep their order.
std::vector<uint32_t> by_weight(const std::vector<double>& weights) {
  std::vector<uint32_t> order(weights.size());
  std::iota(order.begin(), order.end(), uint32_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t a, uint32_t b) { return weights[a] > weights[b]; });
  return order;
}

void append(std::string& bytes, const SplatRow& row) {
  float floats[6];
  uint8_t colors[8];
  double norm = 0;
  for (size_t k = 0; k < 4; ++k) norm += double(row.quat[k]) * row.quat[k];
  norm = std::sqrt(norm);
  for (size_t k = 0; k < 3; ++k) {
    floats[k] = row.mean[k];
    floats[3 + k] = std::exp(row.log_scales[k]);
    colors[k] = to_byte(255 * color_of_sh0(row.sh0[k]));
  }
  colors[3] = to_byte(255 * opacity_of_logit(*row.logit_opacity));
  for (size_t k = 0; k < 4; ++k)
    colors[4 + k] = to_byte(128 + 128 * (norm > 0 ? row.quat[k] / norm : double(k == 0)));
  bytes.append(reinterpret_cast<const char*>(floats), sizeof floats);
  bytes.append(reinterpret_cast<const char*>(colors), sizeof colors);
}

}  // namespace

PlyTable read_dot_splat(const std::string& path) {
  FilePieces file(path);
  return read_dot_splat(file);
}

PlyTable read_dot_splat(FilePieces& file) {
  const std::string& path = file.path();
  const size_t size = file.left();
  if (size == 0 || size % kSize)
    throw Error(
        fmt::format("cannot read {}: a .splat file has {} bytes per Gaussian, and {} is not a "
                    "multiple of that; it is truncated or not a .splat file",
                    path, kSize, size));
  SplatTable table(size / kSize, 0, Normals::none);
  for (size_t i = 0; i < table.table.rows; ++i, file.step(kSize)) {
    const std::string_view bytes = file.ahead(kSize);
    if (bytes.size() < kSize)
      throw Error(fmt::format("cannot read {}: it was truncated while being read", path));
    const auto* at = reinterpret_cast<const uint8_t*>(bytes.data());
    const SplatRow row = table.row(i);
    std::memcpy(row.mean, at, 3 * sizeof(float));
    read_log_scales(at + 12, i, path, row.log_scales);
    for (size_t k = 0; k < 3; ++k) row.sh0[k] = sh0_of_color(at[24 + k] / 255.0);
    *row.logit_opacity = logit_of_opacity(at[27] / 255.0);
    for (size_t k = 0; k < 4; ++k) row.quat[k] = (float(at[28 + k]) - 128) / 128;
  }
  return std::move(table.table);
}

void write_dot_splat(const std::string& path, const PlyTable& table) {
  const StandardRows standard(table, path);
  write_dot_splat(path, table.rows, standard.sh_degree(),
                  [&](size_t i, float* values) { standard.copy(i, values); });
}

void write_dot_splat(const std::string& path, size_t rows, int sh_degree, const PlyRow& row) {
  if (rows > std::numeric_limits<uint32_t>::max())
    throw Error(fmt::format("cannot write {}: {} Gaussians are too many", path, rows));
  std::string bytes;
  std::vector<double> weights;
  bytes.reserve(kSize * rows);
  weights.reserve(rows);
  SplatTable one(1, sh_degree);
  for (size_t i = 0; i < rows; ++i) {
    row(i, one.table.values.data());
    append(bytes, one.row(0));
    weights.push_back(weight_of(one.row(0)));
  }
  const std::vector<uint32_t> order = by_weight(weights);
  write_file_in_pieces(path, [&](const Append& write) {
    for (const size_t i : order) write({bytes.data() + kSize * i, kSize});
  });
}

}  // namespace gflow
