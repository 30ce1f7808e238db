// SPDX-License-Identifier: Apache-2.0
#include "optim/density/density.hpp"

#include <cmath>

namespace gflow {

Density::Density(Queue& queue)
    : program_(queue, "density.cl"),
      density_accumulate_(program_, "density_accumulate"),
      density_rank_(program_, "density_rank"),
      density_grow_(program_, "density_grow"),
      density_sources_(program_, "density_sources"),
      rows_gather_(program_, "rows_gather"),
      rows_gather_counts_(program_, "rows_gather_counts"),
      scan_(queue),
      sort_(queue) {}

void Density::forget(Queue& queue, size_t count) {
  count_ = count;
  pull_.ensure(queue, count);
  views_.ensure(queue, count);
  pull_.fill(queue, 0.f);
  views_.fill(queue, 0u);
}

void Density::accumulate(Queue& queue, int width, int height, const Buffer<cl_uint>& tiles_touched,
                         const Buffer<float>& v_means2d, size_t count) {
  if (count != count_) forget(queue, count);
  density_accumulate_(queue, Range::over(count), cl_uint(count), 0.5f * float(width),
                      0.5f * float(height), tiles_touched, v_means2d, pull_, views_);
}

void Density::refine(Queue& queue, Parameters& p, Motion& motion, const DensityRule& rule,
                     uint32_t seed) {
  if (count_ != p.count) forget(queue, p.count);
  const cl_uint n = cl_uint(p.count);
  copies_.ensure(queue, n);
  keys_.ensure(queue, n);
  order_.ensure(queue, n);
  density_rank_(queue, Range::over(n), n, rule.grad_threshold,
                std::log(rule.min_opacity / (1 - rule.min_opacity)), std::log(rule.max_scale),
                rule.split.duration, std::sqrt(-2 * std::log(rule.cutoff)),
                p["logit_opacities"].values, p["log_scales"].values, p["means_t"].values, pull_,
                views_, copies_, keys_, order_);
  sort_.sort(queue, keys_, order_, n);
  const cl_uint allowed = rule.cap > n ? cl_uint(rule.cap - n) : 0;
  density_grow_(queue, Range::over(n), n, allowed, keys_, order_, copies_);
  scan_.exclusive(queue, copies_, offsets_, n);
  const size_t count = size_t(scan_.total(queue));
  source_.ensure(queue, count);
  child_.ensure(queue, count);
  density_sources_(queue, Range::over(n), n, copies_, offsets_, source_, child_);

  const cl_uint m = cl_uint(count);
  Parameters fresh(queue, count, p.specs);
  for (size_t g = 0; g < p.groups.size(); ++g) {
    const cl_uint width = cl_uint(p.specs[g].width);
    const Range range = Range::over(count * width);
    const ParameterGroup& from = p.groups[g];
    ParameterGroup& to = fresh.groups[g];
    rows_gather_(queue, range, m, width, 0, source_, child_, from.values, to.values);
    rows_gather_(queue, range, m, width, 1, source_, child_, from.exp_avg, to.exp_avg);
    rows_gather_(queue, range, m, width, 1, source_, child_, from.exp_avg_sq, to.exp_avg_sq);
  }
  rows_gather_counts_(queue, Range::over(count), m, source_, child_, p.rows.steps,
                      fresh.rows.steps);
  rows_gather_counts_(queue, Range::over(count), m, source_, child_, p.rows.refused,
                      fresh.rows.refused);
  rows_gather_(queue, Range::over(count), m, 1, 0, source_, child_, p.rows.pace, fresh.rows.pace);
  rows_gather_(queue, Range::over(count), m, 1, 0, source_, child_, p.rows.reach, fresh.rows.reach);
  p = std::move(fresh);
  motion.split(queue, p, child_, rule.split, seed);
  forget(queue, count);
}

}  // namespace gflow
