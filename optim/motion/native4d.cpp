// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/native4d.hpp"

#include <algorithm>
#include <cmath>

#include "shared/motion/native4d.h"

namespace gflow {

Native4dMotion::Native4dMotion(Queue& queue, float cutoff)
    : cutoff_(cutoff),
      program_(queue, "motion/native4d.cl"),
      native4d_fwd_(program_, "native4d_fwd"),
      native4d_cull_(program_, "native4d_cull"),
      native4d_bwd_(program_, "native4d_bwd"),
      native4d_split_(program_, "native4d_split"),
      native4d_pace_(program_, "native4d_rate_scale") {}

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

bool Native4dMotion::cull(Queue& queue, const Parameters& p, float t, const PinholeCamera& camera,
                          ViewRows& rows) {
  rows.ensure_marks(queue, p);
  native4d_cull_(queue, Range::over(rows.groups()), cl_uint(p.count), cl_uint(p.moving), t, cutoff_,
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

void Native4dMotion::set_rate_scales(Queue& queue, Parameters& p, const PaceRule& rule) {
  native4d_pace_(queue, Range::over(p.count), cl_uint(p.count), rule.duration, rule.power,
                 rule.most, p["log_scales"].values, p.rows.rate_scale);
}

void Native4dMotion::split(Queue& queue, Parameters& p, const Buffer<cl_uint>& child,
                           const SplitRule& rule, uint32_t seed) {
  native4d_split_(queue, Range::over(p.count), cl_uint(p.count), cl_uint(p.moving), seed,
                  rule.split_scale, rule.split_travel, rule.min_lifetime, rule.duration, child,
                  p["means"].values, p["means_t"].values, p["quats"].values, p["quats_r"].values,
                  p["log_scales"].values, p["logit_opacities"].values);
}

namespace {

// The two unit quaternions (w x y z) of a 4D rotation that gives a Gaussian with spatial scale s
// and temporal scale s_t the velocity v (kernels/shared/motion/native4d.h).
struct QuatPair {
  std::array<float, 4> left, right;
};
QuatPair quats_for_velocity(const std::array<double, 3>& v, double s, double s_t) {
  const double speed = std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
  if (speed == 0) return {{1, 0, 0, 0}, {1, 0, 0, 0}};
  // speed = (1 - r^2) tau / (1 + r^2 tau^2), r = s/s_t, tau = tan of the angle between v and time
  const double rr = (s / s_t) * (s / s_t), b = 1 - rr;
  const double discriminant = b * b - 4 * speed * speed * rr;
  const double tau = discriminant > 0 ? 2 * speed / (b + std::sqrt(discriminant)) : s_t / s;
  const double half = 0.5 * std::atan(tau), k = std::sin(half) / speed;
  const auto f = [](double value) { return float(value); };
  const double w = std::cos(half);
  return {{f(w), f(k * v[0]), f(k * v[1]), f(k * v[2])},
          {f(w), f(-k * v[0]), f(-k * v[1]), f(-k * v[2])}};
}

}  // namespace

const MotionModel& native4d_model() {
  static const MotionModel model = [] {
    MotionModel m;
    m.name = "native4d";
    m.has_stiff_paths = true;
    m.has_quick_shapes = false;  // the shape in space and time is the path
    m.make = [](Queue& queue, const MotionShape& shape) -> std::unique_ptr<Motion> {
      return std::make_unique<Native4dMotion>(queue, shape.cutoff);
    };
    m.groups = [](const MotionShape&) { return native4d_groups(); };
    m.columns = [](const MotionShape&) -> std::vector<MotionColumns> {
      return {{"quats_r", {"rot_r_0", "rot_r_1", "rot_r_2", "rot_r_3"}}};
    };
    m.set_static = [](const MotionShape&, HostGroups& groups, size_t, uint32_t) {
      groups["quats_r"] = groups.at("quats");
    };
    m.set_velocity = [](const MotionShape&, HostGroups& groups, size_t i,
                        const std::array<double, 3>& v, double s, double s_t) {
      const QuatPair q = quats_for_velocity(v, s, s_t);
      std::copy(q.left.begin(), q.left.end(), &groups.at("quats")[4 * i]);
      std::copy(q.right.begin(), q.right.end(), &groups.at("quats_r")[4 * i]);
    };
    m.lifetime = [](const HostGroups& groups, size_t i) {
      const auto row = [&](const char* group) {
        const float* v = &groups.at(group)[4 * i];
        return make_real4(double(v[0]), double(v[1]), double(v[2]), double(v[3]));
      };
      const Frame4 frame = frame4(quat_normalize(row("quats")).q, quat_normalize(row("quats_r")).q);
      const real4 p_t = rows_of(frame, exp(row("log_scales"))).t;
      return std::sqrt(dot(p_t, p_t));
    };
    m.is_static = [](const MotionShape&, const HostGroups& groups) {
      return groups.at("quats") == groups.at("quats_r");
    };
    return m;
  }();
  return model;
}

}  // namespace gflow
