// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/bases.hpp"

#include <algorithm>
#include <cmath>

#include "optim/motion/farthest_points.hpp"
#include "optim/motion/motion_options.hpp"
#include "runtime/cl/chunks.hpp"
#include "shared/motion/bases.h"

namespace gflow {
namespace {

constexpr size_t kPose = 7;
constexpr float kLeastLogit = -10;  // of a Gaussian that follows no basis

}  // namespace

std::vector<TableSpec> bases_tables(int keys, int bases) {
  TableSpec path, fixed;
  path.groups = {{"basis_shifts", 3, Quantity::position, 0, true},
                 {"basis_turns", 4, Quantity::rotation, 0, true}};
  path.rows = size_t(keys) * size_t(bases);
  fixed.groups = {{"pivots", 3, Quantity::position, 0, true}};
  fixed.rows = size_t(bases);
  return {path, fixed};
}

void place_bases(const MotionShape& shape, HostGroups& groups, size_t first, size_t end) {
  const std::vector<float>& means = groups.at("means");
  const size_t n = means.size() / 3, bases = size_t(shape.bases);
  if (end == 0) return;
  // The spacing is that of the next point, so that a single pivot has one.
  std::vector<size_t> chosen = farthest_points(means, first, end, bases + (bases == 1));
  double spacing = std::numeric_limits<double>::max();
  for (size_t b = 0; b + 1 < chosen.size(); ++b)
    spacing = std::min(spacing, squared_distance(means, chosen[b], chosen.back()));
  chosen.resize(bases, chosen[0]);
  spacing = std::max(spacing, 1e-12);
  for (size_t b = 0; b < bases; ++b)
    for (size_t c = 0; c < 3; ++c) groups["pivots"][3 * b + c] = means[3 * chosen[b] + c];
  for (size_t i = 0; i < n; ++i)
    for (size_t b = 0; b < bases; ++b) {
      const double d = squared_distance(means, i, chosen[b]) / spacing;
      groups["basis_logits"][i * bases + b] = float(std::max(3 - 5 * d, double(kLeastLogit)));
    }
}

BasesMotion::BasesMotion(Queue& queue, const MotionShape& shape)
    : shape_(shape),
      program_(queue, "motion/bases.cl"),
      bases_pose_(program_, "bases_pose"),
      bases_fwd_(program_, "bases_fwd"),
      bases_cull_(program_, "bases_cull"),
      bases_bwd_(program_, "bases_bwd"),
      bases_gather_(program_, "bases_gather"),
      canonical_rows_(queue) {
  if (shape.keys < 1 || shape.bases < 1 || shape.bases > MAX_BASES)
    throw Error(fmt::format("a bases model needs at least one key and 1 to {} bases, not {} and {}",
                            MAX_BASES, shape.keys, shape.bases));
}

std::vector<GroupSpec> bases_groups(int bases) {
  std::vector<GroupSpec> groups = canonical_groups();
  groups.push_back({"basis_logits", size_t(bases), Quantity::weight, 0, true, true, kLeastLogit});
  return groups;
}

KeyWeights BasesMotion::pose(Queue& queue, const Parameters& p, float t) {
  const KeyWeights keys = key_weights(t, shape_.duration, shape_.keys);
  poses_.ensure(queue, kPose * size_t(shape_.bases));
  bases_pose_(queue, Range::over(size_t(shape_.bases)), shape_.bases, keys,
              p["basis_shifts"].values, p["basis_turns"].values, poses_);
  return keys;
}

void BasesMotion::at(Queue& queue, const Parameters& p, float t, const Buffer<cl_uint>* seen,
                     GaussiansAt& gaussians, const RowList& rows) {
  const size_t n = rows.count_of(p);
  gaussians.ensure(queue, n);
  pose(queue, p, t);
  bases_fwd_(queue, Range::over(n), cl_uint(n), cl_uint(p.moving), shape_.bases, t,
             window_sigmas(shape_.cutoff), int(!seen), rows.buffer(), seen ? *seen : p.rows.seen,
             p["means"].values, p["means_t"].values, p["quats"].values, p["log_scales"].values,
             p["logit_opacities"].values, p["basis_logits"].values, poses_, p["pivots"].values,
             gaussians.means, gaussians.factors, gaussians.opacities);
}

bool BasesMotion::cull(Queue& queue, const Parameters& p, float t, const PinholeCamera& camera,
                       ViewRows& rows) {
  rows.ensure_marks(queue, p);
  pose(queue, p, t);
  bases_cull_(queue, Range::over(rows.groups()), cl_uint(p.count), cl_uint(p.moving), shape_.bases,
              t, window_sigmas(shape_.cutoff), camera, p["means"].values, p["means_t"].values,
              p["quats"].values, p["log_scales"].values, p["logit_opacities"].values,
              p["basis_logits"].values, poses_, p["pivots"].values, rows.marks, rows.counts);
  return true;
}

void BasesMotion::backward(Queue& queue, Parameters& p, float t, bool first,
                           const Buffer<cl_uint>& tiles_touched, const Buffer<float>& v_means,
                           const Buffer<float>& v_factors, const Buffer<float>& v_opacities,
                           const RowList& rows) {
  const size_t n = rows.count_of(p);
  const KeyWeights keys = pose(queue, p, t);
  const Chunks chunks = chunks_of_sums(n, 64, queue.lanes == 1 ? 1024 : 64);
  partials_.ensure(queue, chunks.count * kPose * size_t(shape_.bases));
  partials_.fill(queue, 0.f);  // the last chunks may be empty
  bases_bwd_(queue, Range::over(chunks.count, chunk_group(queue) == 1 ? 1 : 64), cl_uint(n),
             cl_uint(p.moving), chunks.length, shape_.bases, t, int(first), rows.buffer(),
             p["means"].values, p["means_t"].values, p["quats"].values, p["log_scales"].values,
             p["logit_opacities"].values, p["basis_logits"].values, poses_, p["pivots"].values,
             tiles_touched, v_means, v_factors, v_opacities, p.rows.seen, p["means"].grads,
             p["means_t"].grads, p["quats"].grads, p["log_scales"].grads,
             p["logit_opacities"].grads, p["basis_logits"].grads, partials_);
  Table& path = p.more[0];
  bases_gather_(queue, Range::over(size_t(shape_.bases)), chunks.count, shape_.bases, keys,
                p["basis_turns"].values, partials_, path.rows.seen, p["basis_shifts"].grads,
                p["basis_turns"].grads);
  const size_t bases = size_t(shape_.bases);
  path.active = path.active.joined({size_t(keys.first) * bases, size_t(keys.count) * bases});
}

void BasesMotion::set_rate_scales(Queue& queue, Parameters& p, const PaceRule& rule) {
  canonical_rows_.set_rate_scales(queue, p, rule);
  p.more[0].rows.rate_scale.fill(queue, key_rate_scale(shape_.keys, rule));
}

void BasesMotion::split(Queue& queue, Parameters& p, const Buffer<cl_uint>& child,
                        const SplitRule& rule, uint32_t seed) {
  canonical_rows_.split(queue, p, child, rule, seed);
}

const MotionModel& bases_model() {
  static const MotionModel model = [] {
    MotionModel m;
    m.name = "bases";
    m.has_quick_shapes = false;
    m.numbers = {key_count(),
                 {"bases", [](MotionShape& shape) -> int& { return shape.bases; }, 0, 1e3}};
    m.set_numbers = [](MotionShape& shape, const MotionOptions& options, int time_steps) {
      shape.keys = options.keys > 0 ? options.keys : time_steps;
      shape.bases = options.bases;
    };
    m.make = [](Queue& queue, const MotionShape& shape) -> std::unique_ptr<Motion> {
      return std::make_unique<BasesMotion>(queue, shape);
    };
    m.groups = [](const MotionShape& shape) { return bases_groups(shape.bases); };
    m.tables = [](const MotionShape& shape) { return bases_tables(shape.keys, shape.bases); };
    m.columns = [](const MotionShape& shape) -> std::vector<MotionColumns> {
      MotionColumns columns{"basis_logits", {}};
      for (int b = 0; b < shape.bases; ++b)
        columns.properties.push_back(fmt::format("basis_{}", b));
      return {columns};
    };
    m.place = place_bases;
    m.is_static = [](const MotionShape&, const HostGroups& groups) {
      const auto zero = [&](const char* group) {
        const std::vector<float>& values = groups.at(group);
        return std::all_of(values.begin(), values.end(), [](float x) { return x == 0; });
      };
      return zero("basis_shifts") && zero("basis_turns");
    };
    return m;
  }();
  return model;
}

}  // namespace gflow
