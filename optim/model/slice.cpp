// SPDX-License-Identifier: Apache-2.0
#include "optim/model/slice.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace gflow {

// L = U diag(s) V^T gives L L^T = U diag(s)^2 U^T, and s_k = |L^T u_k|. The SVD of L itself keeps
// the small scales of a flat Gaussian, which the eigenvalues of L L^T lose.
FactorParts parts_of_factor(const float* factor) {
  const Eigen::Matrix3d l =
      Eigen::Map<const Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(factor).cast<double>();
  Eigen::Matrix3d u = Eigen::JacobiSVD<Eigen::Matrix3d>(l, Eigen::ComputeFullU).matrixU();
  const auto scale = [&](long k) { return (l.transpose() * u.col(k)).norm(); };
  FactorParts parts{{scale(0), scale(1), scale(2)}, {}};
  if (u.determinant() < 0) u.col(2) = -u.col(2);
  const Eigen::Quaterniond q(u);
  parts.quat = {q.w(), q.x(), q.y(), q.z()};
  return parts;
}

namespace {

constexpr size_t kPiece = size_t{1} << 14;  // Gaussians per block

}  // namespace

SliceRows::SliceRows(Queue& queue, Model& model, double scene_time)
    : queue_(queue),
      model_(model),
      table_(0, model.shape.sh_degree),
      one_(1, model.shape.sh_degree) {
  model.motion->at(queue, model.parameters, model.time(scene_time), nullptr, at_);
  for (size_t first = 0; first < model.parameters.count; first += kPiece) {
    const size_t count = std::min(kPiece, model.parameters.count - first);
    opacities_ = at_.opacities.read_range(queue, first, count);
    factors_ = at_.factors.read_range(queue, 9 * first, 9 * count);
    // Gaussians whose scales overflow a float are not drawn either.
    for (size_t i = 0; i < count; ++i)
      if (opacities_[i] > 0 && std::all_of(&factors_[9 * i], &factors_[9 * i] + 9,
                                           [](float f) { return std::isfinite(f); }))
        there_.push_back(uint32_t(first + i));
  }
  table_.table.rows = there_.size();
  table_.table.origin = model.shape.origin;
}

void SliceRows::fetch(size_t first) {
  first_ = first;
  count_ = std::min(kPiece, model_.parameters.count - first);
  const auto piece_of = [&](const Buffer<float>& buffer, size_t width) {
    return buffer.read_range(queue_, width * first, width * count_);
  };
  means_ = piece_of(at_.means, 3);
  factors_ = piece_of(at_.factors, 9);
  opacities_ = piece_of(at_.opacities, 1);
  sh0_ = piece_of(model_.parameters["sh0"].values, 3);
  if (table_.rest > 0) sh_rest_ = piece_of(model_.parameters["sh_rest"].values, table_.rest);
}

void SliceRows::row(size_t to, float* values) {
  if (there_[to] < first_ || there_[to] >= first_ + count_) fetch(there_[to]);
  const size_t i = there_[to] - first_, rest = table_.rest / 3;
  const SplatRow row = one_.row(0);
  const FactorParts parts = parts_of_factor(&factors_[9 * i]);
  for (size_t k = 0; k < 3; ++k) {
    row.mean[k] = means_[3 * i + k];
    row.sh0[k] = sh0_[3 * i + k];
    row.log_scales[k] =
        std::log(std::max(float(parts.scales[k]), std::numeric_limits<float>::min()));
    for (size_t c = 0; c < rest; ++c) row.sh_rest[k * rest + c] = sh_rest_[3 * (i * rest + c) + k];
  }
  for (size_t k = 0; k < 4; ++k) row.quat[k] = float(parts.quat[k]);
  *row.logit_opacity = logit_of_opacity(opacities_[i]);
  std::copy(one_.table.values.begin(), one_.table.values.end(), values);
}

SplatTable slice(Queue& queue, Model& model, double scene_time) {
  SliceRows rows(queue, model, scene_time);
  SplatTable table(rows.head().rows, rows.sh_degree());
  table.table.origin = rows.head().origin;
  const size_t columns = table.table.names.size();
  for (size_t i = 0; i < table.table.rows; ++i) rows.row(i, &table.table.values[i * columns]);
  return table;
}

}  // namespace gflow
