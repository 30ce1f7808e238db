// SPDX-License-Identifier: Apache-2.0
// Launches kernels/engine/camera_gradient.cl.
#include "optim/engine/camera_gradient.hpp"

#include <algorithm>

namespace gflow {
namespace {

constexpr size_t kGaussiansPerItem = 64, kMostItems = 1024;

}  // namespace

CameraGradients::CameraGradients(Queue& queue)
    : program_(queue, "engine/camera_gradient.cl"),
      camera_gradient_sums_(program_, "camera_gradient_sums") {}

void CameraGradients::add(Queue& queue, const PinholeCamera& camera, size_t n,
                          const GaussiansAt& gaussians, const Buffer<cl_uint>& shown,
                          const Buffer<float>& v_means, const Buffer<float>& v_factors) {
  if (started_ == sums_.size()) sums_.emplace_back();
  Sum& sum = sums_[started_++];
  sum.items = std::clamp<size_t>(n / kGaussiansPerItem, 1, kMostItems);
  sum.values.ensure(queue, CAMERA_GRADIENT_SIZE * sum.items);
  camera_gradient_sums_(queue, Range::over(sum.items), cl_uint(n), cl_uint(sum.items), camera,
                        gaussians.means, gaussians.factors, shown, v_means, v_factors, sum.values);
}

void CameraGradients::start(Queue& queue, const View& view, bool flow, const Splats& splats,
                            const GaussiansAt& at_t1, const GaussiansAt& at_t2,
                            const GaussianGradients& gradients) {
  add(queue, view.camera, splats.count, at_t1, splats.tiles_touched, gradients.v_means,
      gradients.v_factors);
  if (!flow) return;
  // Rows that are static in the view have the same camera at both times and no flow.
  const size_t moving = std::min(view.moving, splats.count);
  add(queue, view.camera_t2, moving, at_t2, splats.rows_with_flow(), gradients.v_means_t2,
      gradients.v_factors_t2);
}

std::vector<CameraSums> CameraGradients::take(Queue& queue) {
  std::vector<CameraSums> taken(started_, CameraSums{});
  for (size_t s = 0; s < started_; ++s) {
    const std::vector<float> values = sums_[s].values.read(queue);
    for (size_t k = 0; k < values.size(); ++k) taken[s][k / sums_[s].items] += double(values[k]);
  }
  started_ = 0;
  return taken;
}

}  // namespace gflow
