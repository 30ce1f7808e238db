// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/keyframes.hpp"

#include <algorithm>

#include "optim/motion/motion_options.hpp"

namespace gflow {

std::vector<TableSpec> keyframes_tables(const MotionShape& shape) {
  TableSpec table;
  table.groups = {{"key_shifts", 3, Quantity::position, 0, true},
                  {"key_turns", 4, Quantity::rotation, 0, true}};
  if (shape.key_scales) table.groups.push_back({"key_scales", 3, Quantity::scale, 0, true});
  table.keys = size_t(shape.keys);
  return {table};
}

KeyframesMotion::KeyframesMotion(Queue& queue, const MotionShape& shape)
    : shape_(shape),
      scales_(shape.key_scales ? "key_scales" : "key_shifts"),
      program_(queue, "motion/keyframes.cl", {{"SCALES", shape.key_scales}}),
      keyframes_fwd_(program_, "keyframes_fwd"),
      keyframes_cull_(program_, "keyframes_cull"),
      keyframes_bwd_(program_, "keyframes_bwd"),
      keyframes_start_(program_, "keyframes_start"),
      canonical_rows_(queue) {
  if (shape.keys < 1) throw Error("a keyframes model needs at least one key");
}

void KeyframesMotion::at(Queue& queue, const Parameters& p, float t, const Buffer<cl_uint>* seen,
                         GaussiansAt& gaussians, const RowList& rows) {
  const size_t n = rows.count_of(p);
  gaussians.ensure(queue, n);
  keyframes_fwd_(queue, Range::over(n), cl_uint(n), cl_uint(p.moving), t,
                 window_sigmas(shape_.cutoff), int(!seen),
                 key_weights(t, shape_.duration, shape_.keys), rows.buffer(),
                 seen ? *seen : p.rows.seen, p["means"].values, p["means_t"].values,
                 p["quats"].values, p["log_scales"].values, p["logit_opacities"].values,
                 p["key_shifts"].values, p["key_turns"].values, p[scales_].values, gaussians.means,
                 gaussians.factors, gaussians.opacities);
}

bool KeyframesMotion::cull(Queue& queue, const Parameters& p, float t, const PinholeCamera& camera,
                           ViewRows& rows) {
  rows.ensure_marks(queue, p);
  keyframes_cull_(queue, Range::over(rows.groups()), cl_uint(p.count), cl_uint(p.moving), t,
                  window_sigmas(shape_.cutoff), camera,
                  key_weights(t, shape_.duration, shape_.keys), p["means"].values,
                  p["means_t"].values, p["quats"].values, p["log_scales"].values,
                  p["logit_opacities"].values, p["key_shifts"].values, p["key_turns"].values,
                  p[scales_].values, rows.marks, rows.counts);
  return true;
}

void KeyframesMotion::backward(Queue& queue, Parameters& p, float t, bool first,
                               const Buffer<cl_uint>& tiles_touched, const Buffer<float>& v_means,
                               const Buffer<float>& v_factors, const Buffer<float>& v_opacities,
                               const RowList& rows) {
  const size_t n = rows.count_of(p);
  const KeyWeights keys = key_weights(t, shape_.duration, shape_.keys);
  Table& table = p.more[0];
  keyframes_bwd_(queue, Range::over(n), cl_uint(n), cl_uint(p.moving), t, int(first), keys,
                 rows.buffer(), p["means"].values, p["means_t"].values, p["quats"].values,
                 p["log_scales"].values, p["logit_opacities"].values, p["key_shifts"].values,
                 p["key_turns"].values, p[scales_].values, tiles_touched, v_means, v_factors,
                 v_opacities, p.rows.seen, p["means"].grads, p["means_t"].grads, p["quats"].grads,
                 p["log_scales"].grads, p["logit_opacities"].grads, table.rows.seen,
                 p["key_shifts"].grads, p["key_turns"].grads, p[scales_].grads);
  const RowRange touched{size_t(keys.first) * p.moving, size_t(keys.count) * p.moving};
  table.active = table.active.joined(touched);
}

void KeyframesMotion::set_rate_scales(Queue& queue, Parameters& p, const PaceRule& rule) {
  canonical_rows_.set_rate_scales(queue, p, rule);
  p.more[0].rows.rate_scale.fill(queue, key_rate_scale(shape_.keys, rule));
}

void KeyframesMotion::start_key(Queue& queue, Parameters& p, int key) {
  if (key < 1 || key >= shape_.keys)
    throw Error(fmt::format("cannot start key {} of {}", key, shape_.keys));
  for (ParameterGroup& group : p.more[0].groups)
    keyframes_start_(queue, Range::over(p.moving * group.width), cl_uint(p.moving),
                     cl_uint(group.width), cl_uint(key), group.values);
}

void KeyframesMotion::split(Queue& queue, Parameters& p, const Buffer<cl_uint>& child,
                            const SplitRule& rule, uint32_t seed) {
  canonical_rows_.split(queue, p, child, rule, seed);
}

const MotionModel& keyframes_model() {
  static const MotionModel model = [] {
    MotionModel m;
    m.name = "keyframes";
    m.numbers = {
        key_count(),
        {"key_scales", [](MotionShape& shape) -> int& { return shape.key_scales; }, -1, 1}};
    m.set_numbers = [](MotionShape& shape, const MotionOptions& options, int time_steps) {
      shape.keys = options.keys > 0 ? options.keys : time_steps;
      shape.key_scales = options.key_scales;
    };
    m.keys = [](const MotionShape& shape) { return shape.keys; };
    m.make = [](Queue& queue, const MotionShape& shape) -> std::unique_ptr<Motion> {
      return std::make_unique<KeyframesMotion>(queue, shape);
    };
    m.groups = [](const MotionShape&) { return canonical_groups(); };
    m.tables = keyframes_tables;
    m.set_velocity = [](const MotionShape& shape, HostGroups& groups, size_t i,
                        const std::array<double, 3>& v, double, double s_t) {
      const size_t count = groups.at("means_t").size();
      const double own = groups.at("means_t")[i];
      const double step = double(shape.duration) / std::max(shape.keys - 1, 1);
      const double most = std::max(3 * s_t, 2 * step);  // extrapolate no further
      for (size_t k = 0; k < size_t(shape.keys); ++k) {
        const double times = std::clamp(double(k) * step - own, -most, most);
        for (size_t c = 0; c < 3; ++c)
          groups.at("key_shifts")[3 * (k * count + i) + c] = float(times * v[c]);
      }
    };
    return m;
  }();
  return model;
}

}  // namespace gflow
