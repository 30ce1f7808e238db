// SPDX-License-Identifier: Apache-2.0
#include "optim/train/slice.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

namespace gflow {

// L = U diag(s) V^T gives L L^T = U diag(s)^2 U^T, and s_k = |L^T u_k|. From L itself: the
// eigenvalues of L L^T would have lost the small scales of a flat Gaussian.
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

SplatTable slice(Queue& queue, Model& model, double scene_time) {
  GaussiansAt at;
  model.motion->at(queue, model.parameters, model.time(scene_time), nullptr, at);
  const std::vector<float> means = at.means.read(queue), factors = at.factors.read(queue);
  const std::vector<float> opacities = at.opacities.read(queue);
  const std::vector<float> sh0 = model.parameters["sh0"].values.read(queue);
  std::vector<float> sh_rest;
  if (model.shape.sh_degree > 0) sh_rest = model.parameters["sh_rest"].values.read(queue);
  std::vector<size_t> there;
  for (size_t i = 0; i < model.parameters.count; ++i)
    if (opacities[i] > 0) there.push_back(i);

  SplatTable table(there.size(), model.shape.sh_degree);
  table.table.origin = model.shape.origin;
  const size_t rest = table.rest / 3;
  for (size_t to = 0; to < there.size(); ++to) {
    const size_t i = there[to];
    const SplatRow row = table.row(to);
    const FactorParts parts = parts_of_factor(&factors[9 * i]);
    for (size_t k = 0; k < 3; ++k) {
      row.mean[k] = means[3 * i + k];
      row.sh0[k] = sh0[3 * i + k];
      row.log_scales[k] =
          std::log(std::max(float(parts.scales[k]), std::numeric_limits<float>::min()));
      for (size_t c = 0; c < rest; ++c) row.sh_rest[k * rest + c] = sh_rest[3 * (i * rest + c) + k];
    }
    for (size_t k = 0; k < 4; ++k) row.quat[k] = float(parts.quat[k]);
    *row.logit_opacity = logit_of_opacity(opacities[i]);
  }
  return table;
}

}  // namespace gflow
