// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/native4d.hpp"

#include <algorithm>

namespace gflow {

Native4dMotion::Native4dMotion(Queue& queue, float cutoff)
    : cutoff_(cutoff),
      program_(queue, "native4d.cl"),
      native4d_fwd_(program_, "native4d_fwd"),
      native4d_look_(program_, "native4d_look"),
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
                        GaussiansAt& gaussians, const RowList& rows) {
  const size_t n = rows.count_of(p);
  gaussians.ensure(queue, n);
  native4d_fwd_(queue, Range::over(n), cl_uint(n), cl_uint(p.moving), t, cutoff_, int(!seen),
                rows.buffer(), seen ? *seen : p.rows.seen, p["means"].values, p["means_t"].values,
                p["quats"].values, p["quats_r"].values, p["log_scales"].values,
                p["logit_opacities"].values, gaussians.means, gaussians.factors,
                gaussians.opacities);
}

bool Native4dMotion::look(Queue& queue, const Parameters& p, float t, const PinholeCamera& camera,
                          ViewRows& rows) {
  rows.ensure_marks(queue, p);
  native4d_look_(queue, Range::over(rows.groups()), cl_uint(p.count), cl_uint(p.moving), t, cutoff_,
                 camera, p["means"].values, p["means_t"].values, p["quats"].values,
                 p["quats_r"].values, p["log_scales"].values, p["logit_opacities"].values,
                 rows.marks, rows.counts);
  return true;
}

void Native4dMotion::backward(Queue& queue, Parameters& p, float t, bool first,
                              const Buffer<cl_uint>& tiles_touched, const Buffer<float>& v_means,
                              const Buffer<float>& v_factors, const Buffer<float>& v_opacities,
                              const RowList& rows) {
  const size_t n = rows.count_of(p);
  native4d_bwd_(queue, Range::over(n), cl_uint(n), cl_uint(p.moving), t, int(first), rows.buffer(),
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
