// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/native4d.hpp"

#include <algorithm>

namespace gflow {

Native4dMotion::Native4dMotion(Queue& queue, float cutoff)
    : cutoff_(cutoff),
      program_(queue, "native4d.cl"),
      native4d_fwd_(program_, "native4d_fwd"),
      native4d_seen_fwd_(program_, "native4d_seen_fwd"),
      native4d_bwd_(program_, "native4d_bwd"),
      native4d_split_(program_, "native4d_split"),
      native4d_pace_(program_, "native4d_pace") {}

std::vector<GroupSpec> native4d_groups() {
  return {{"means", 3},
          {"means_t", 1, Quantity::time, 0, true},
          {"quats", 4, Quantity::rotation},
          {"quats_r", 4, Quantity::rotation, 0, false, true, 0, "quats"},
          {"log_scales", 4, Quantity::scale},
          {"logit_opacities", 1, Quantity::opacity}};
}

void Native4dMotion::at(Queue& queue, const Parameters& p, float t, const Buffer<cl_uint>* seen,
                        GaussiansAt& gaussians, size_t rows) {
  const size_t n = std::min(rows, p.count);
  gaussians.ensure(queue, p.count);
  native4d_fwd_(queue, Range::over(n), cl_uint(n), cl_uint(p.moving), t, cutoff_, int(!seen),
                seen ? *seen : p.rows.seen, p["means"].values, p["means_t"].values,
                p["quats"].values, p["quats_r"].values, p["log_scales"].values,
                p["logit_opacities"].values, gaussians.means, gaussians.factors,
                gaussians.opacities);
}

void Native4dMotion::seen_at(Queue& queue, const Parameters& p, float t,
                             const PinholeCamera& camera, GaussiansAt& gaussians) {
  gaussians.ensure(queue, p.count);
  const size_t lanes = size_t(queue.lanes);
  native4d_seen_fwd_(queue, Range::over((p.count + lanes - 1) / lanes), cl_uint(p.count),
                     cl_uint(p.moving), t, cutoff_, camera, p["means"].values, p["means_t"].values,
                     p["quats"].values, p["quats_r"].values, p["log_scales"].values,
                     p["logit_opacities"].values, gaussians.means, gaussians.factors,
                     gaussians.opacities);
}

void Native4dMotion::backward(Queue& queue, Parameters& p, float t, bool first,
                              const Buffer<cl_uint>& tiles_touched, const Buffer<float>& v_means,
                              const Buffer<float>& v_factors, const Buffer<float>& v_opacities,
                              size_t rows) {
  const size_t n = std::min(rows, p.count);
  native4d_bwd_(queue, Range::over(n), cl_uint(n), cl_uint(p.moving), t, int(first),
                p["means"].values, p["means_t"].values, p["quats"].values, p["quats_r"].values,
                p["log_scales"].values, p["logit_opacities"].values, tiles_touched, v_means,
                v_factors, v_opacities, p.rows.seen, p["means"].grads, p["means_t"].grads,
                p["quats"].grads, p["quats_r"].grads, p["log_scales"].grads,
                p["logit_opacities"].grads);
}

void Native4dMotion::set_pace(Queue& queue, Parameters& p, const PaceRule& rule) {
  native4d_pace_(queue, Range::over(p.count), cl_uint(p.count), rule.duration, rule.power,
                 rule.most, p["log_scales"].values, p.rows.pace);
}

void Native4dMotion::split(Queue& queue, Parameters& p, const Buffer<cl_uint>& child,
                           const SplitRule& rule, uint32_t seed) {
  native4d_split_(queue, Range::over(p.count), cl_uint(p.count), cl_uint(p.moving), seed,
                  rule.split_scale, rule.split_travel, rule.min_lifetime, rule.duration, child,
                  p["means"].values, p["means_t"].values, p["quats"].values, p["quats_r"].values,
                  p["log_scales"].values, p["logit_opacities"].values);
}

}  // namespace gflow
