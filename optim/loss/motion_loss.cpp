// SPDX-License-Identifier: Apache-2.0
#include "optim/loss/motion_loss.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace gflow {
namespace {

// Knee of the robust norm: smaller differences count by their square. 1e-3 extents are a third of a
// pixel in an image of 300 pixels.
constexpr float kKnee = 1e-3f;  // [x extent]

float median(std::vector<float> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + long(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

MotionLoss::MotionLoss(Queue& queue, const MotionLossWeights& weights)
    : weights_(weights),
      program_(queue, "loss/motion_loss.cl"),
      motion_turns_(program_, "motion_rotations"),
      motion_pairs_(program_, "motion_pairs"),
      motion_bends_(program_, "motion_acceleration"),
      reduce_(queue) {
  if (!(weights.extent > 0) || !std::isfinite(weights.extent))
    throw Error(
        fmt::format("motion loss: the scene's extent is {}; it must be above 0", weights.extent));
}

void MotionLoss::set_pairs(Queue& queue, NeighbourPairs pairs) {
  pairs_ = std::move(pairs);
  std::vector<float> weights;
  weights.reserve(pairs_.distances.size());
  const double usual = std::max(median(pairs_.distances), std::numeric_limits<float>::min());
  for (const float distance : pairs_.distances) {
    const double share = double(distance) / usual;
    weights.push_back(float(std::exp(-weights_.neighbour_falloff * share * share)));
  }
  const auto upload = [&](auto& buffer, const auto& values) {
    buffer.ensure(queue, values.size());
    buffer.write(queue, values);
  };
  upload(offsets_, pairs_.offsets);
  upload(others_, pairs_.others);
  upload(distances_, pairs_.distances);
  upload(pair_weights_, weights);
}

void MotionLoss::run(Queue& queue, const Buffer<cl_uint>& seen, const GaussiansAt* at_t0,
                     const GaussiansAt& at_t1, const GaussiansAt& at_t2, GaussianGradients& v) {
  const size_t n = at_t1.opacities.size();
  const float extent = weights_.extent, knee = kKnee * extent;
  ran_pairs_ = weights_.any_pairs();
  ran_bends_ = at_t0 && weights_.acceleration > 0;
  if (ran_pairs_) {
    if (pairs_.offsets.size() != n + 1)
      throw Error(fmt::format("motion loss of {} Gaussians: the neighbour lists are for {}", n,
                              pairs_.offsets.empty() ? 0 : pairs_.offsets.size() - 1));
    const float a_pair = 1 / float(std::max<size_t>(pairs_.others.size() / 2, 1));
    const float a_length = a_pair / extent;
    const MotionLossRule rule{weights_.rigidity * a_length,
                              weights_.rotation * a_pair,
                              weights_.isometry * a_length,
                              weights_.velocity * a_length,
                              0,
                              knee};
    turns_.ensure(queue, 9 * n);
    pair_terms_.ensure(queue, 4 * n);
    if (weights_.any_turns())
      motion_turns_(queue, Range::over(n), cl_uint(n), seen, at_t1.factors, at_t2.factors, turns_);
    motion_pairs_(queue, Range::over(n), cl_uint(n), rule, seen, offsets_, others_, distances_,
                  pair_weights_, at_t1.means, at_t2.means, at_t1.factors, at_t2.factors, turns_,
                  v.v_means, v.v_factors, v.v_means_t2, v.v_factors_t2, pair_terms_);
  }
  if (ran_bends_) {
    const MotionLossRule rule{0, 0, 0, 0, weights_.acceleration / (extent * float(n)), knee};
    bend_terms_.ensure(queue, n);
    motion_bends_(queue, Range::over(n), cl_uint(n), rule, seen, at_t0->means, at_t1.means,
                  at_t2.means, v.v_means_t0, v.v_means, v.v_means_t2, bend_terms_);
  }
}

MotionLossValue MotionLoss::value(Queue& queue) {
  MotionLossValue value;
  if (ran_pairs_) {
    const size_t n = pair_terms_.size() / 4;
    double* const terms[] = {&value.rigidity, &value.rotation, &value.isometry, &value.velocity};
    for (size_t k = 0; k < 4; ++k) *terms[k] = reduce_.sum(queue, pair_terms_, k * n, n);
  }
  if (ran_bends_) value.acceleration = reduce_.sum(queue, bend_terms_);
  return value;
}

}  // namespace gflow
