// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/spacetime.hpp"

#include <algorithm>

namespace gflow {

SpacetimeMotion::SpacetimeMotion(Queue& queue, float cutoff)
    : sigmas_(window_sigmas(cutoff)),
      program_(queue, "motion/spacetime.cl"),
      spacetime_fwd_(program_, "spacetime_fwd"),
      spacetime_cull_(program_, "spacetime_cull"),
      spacetime_bwd_(program_, "spacetime_bwd"),
      spacetime_split_(program_, "spacetime_split"),
      spacetime_pace_(program_, "spacetime_rate_scale") {}

std::vector<GroupSpec> spacetime_groups() {
  return {{"means", 3},
          {"means_t", 1, Quantity::time, 0, true},
          {"velocities", 3, Quantity::position, 1, true, true},
          {"half_accelerations", 3, Quantity::position, 2, true, true},
          {"quats", 4, Quantity::rotation},
          {"turns", 4, Quantity::rotation, 1, true, true},
          {"log_scales", 4, Quantity::scale},
          {"logit_opacities", 1, Quantity::opacity}};
}

void SpacetimeMotion::at(Queue& queue, const Parameters& p, float t, const Buffer<cl_uint>* seen,
                         GaussiansAt& gaussians, const RowList& rows) {
  const size_t n = rows.count_of(p);
  gaussians.ensure(queue, n);
  spacetime_fwd_(queue, Range::over(n), cl_uint(n), cl_uint(p.moving), t, sigmas_, int(!seen),
                 rows.buffer(), seen ? *seen : p.rows.seen, p["means"].values, p["means_t"].values,
                 p["velocities"].values, p["half_accelerations"].values, p["quats"].values,
                 p["turns"].values, p["log_scales"].values, p["logit_opacities"].values,
                 gaussians.means, gaussians.factors, gaussians.opacities);
}

bool SpacetimeMotion::cull(Queue& queue, const Parameters& p, float t, const PinholeCamera& camera,
                           ViewRows& rows) {
  rows.ensure_marks(queue, p);
  spacetime_cull_(queue, Range::over(rows.groups()), cl_uint(p.count), cl_uint(p.moving), t,
                  sigmas_, camera, p["means"].values, p["means_t"].values, p["velocities"].values,
                  p["half_accelerations"].values, p["quats"].values, p["turns"].values,
                  p["log_scales"].values, p["logit_opacities"].values, rows.marks, rows.counts);
  return true;
}

void SpacetimeMotion::backward(Queue& queue, Parameters& p, float t, bool first,
                               const Buffer<cl_uint>& tiles_touched, const Buffer<float>& v_means,
                               const Buffer<float>& v_factors, const Buffer<float>& v_opacities,
                               const RowList& rows) {
  const size_t n = rows.count_of(p);
  spacetime_bwd_(queue, Range::over(n), cl_uint(n), cl_uint(p.moving), t, int(first), rows.buffer(),
                 p["means"].values, p["means_t"].values, p["velocities"].values,
                 p["half_accelerations"].values, p["quats"].values, p["turns"].values,
                 p["log_scales"].values, p["logit_opacities"].values, tiles_touched, v_means,
                 v_factors, v_opacities, p.rows.seen, p["means"].grads, p["means_t"].grads,
                 p["velocities"].grads, p["half_accelerations"].grads, p["quats"].grads,
                 p["turns"].grads, p["log_scales"].grads, p["logit_opacities"].grads);
}

void SpacetimeMotion::set_rate_scales(Queue& queue, Parameters& p, const PaceRule& rule) {
  spacetime_pace_(queue, Range::over(p.count), cl_uint(p.count), rule.duration, rule.time_step,
                  rule.power, rule.most, p["log_scales"].values, p.rows.rate_scale,
                  p.rows.rate_divisor);
}

void SpacetimeMotion::split(Queue& queue, Parameters& p, const Buffer<cl_uint>& child,
                            const SplitRule& rule, uint32_t seed) {
  spacetime_split_(queue, Range::over(p.count), cl_uint(p.count), cl_uint(p.moving), seed,
                   rule.split_scale, rule.split_travel, rule.min_lifetime, rule.duration, child,
                   p["means"].values, p["means_t"].values, p["velocities"].values,
                   p["half_accelerations"].values, p["quats"].values, p["turns"].values,
                   p["log_scales"].values, p["logit_opacities"].values);
}

const MotionModel& spacetime_model() {
  static const MotionModel model = [] {
    MotionModel m;
    m.name = "spacetime";
    m.has_stiff_paths = true;
    m.make = [](Queue& queue, const MotionShape& shape) -> std::unique_ptr<Motion> {
      return std::make_unique<SpacetimeMotion>(queue, shape.cutoff);
    };
    m.groups = [](const MotionShape&) { return spacetime_groups(); };
    m.columns = [](const MotionShape&) -> std::vector<MotionColumns> {
      return {{"velocities", {"motion_0", "motion_1", "motion_2"}},
              {"half_accelerations", {"motion_3", "motion_4", "motion_5"}},
              {"turns", {"omega_0", "omega_1", "omega_2", "omega_3"}}};
    };
    m.set_velocity = [](const MotionShape&, HostGroups& groups, size_t i,
                        const std::array<double, 3>& v, double, double) {
      for (size_t c = 0; c < 3; ++c) groups.at("velocities")[3 * i + c] = float(v[c]);
    };
    return m;
  }();
  return model;
}

}  // namespace gflow
