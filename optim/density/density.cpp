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

void Density::save_state(Queue& queue, Arrays& arrays) const {
  arrays["density/pull"] = {{count_}, pull_.read_range(queue, 0, count_)};
  arrays["density/views"] = {{count_}, views_.read_range(queue, 0, count_)};
}

void Density::load_state(Queue& queue, const Arrays& arrays, const std::string& path) {
  const size_t count = array_named(arrays, "density/pull", path).size();
  const auto& pull = exact_values<float>(arrays, "density/pull", {count}, path);
  const auto& views = exact_values<cl_uint>(arrays, "density/views", {count}, path);
  forget(queue, count);
  pull_.write(queue, pull);
  views_.write(queue, views);
}

void Density::accumulate(Queue& queue, int width, int height, const Buffer<cl_uint>& tiles_touched,
                         const Buffer<float>& v_means2d, size_t count) {
  if (count != count_) forget(queue, count);
  density_accumulate_(queue, Range::over(count), cl_uint(count), 0.5f * float(width),
                      0.5f * float(height), tiles_touched, v_means2d, pull_, views_);
}

void Density::gather(Queue& queue, size_t keys, const Table& from, Table& to) {
  const cl_uint k = cl_uint(keys), n = cl_uint(to.count / keys), old_n = cl_uint(from.count / keys);
  const auto values = [&](size_t width, bool only_old, const Buffer<float>& old,
                          Buffer<float>& fresh) {
    rows_gather_(queue, Range::over(to.count * width), k, n, old_n, cl_uint(width), int(only_old),
                 source_, child_, old, fresh);
  };
  const auto counts = [&](const Buffer<cl_uint>& old, Buffer<cl_uint>& fresh) {
    rows_gather_counts_(queue, Range::over(to.count), k, n, old_n, source_, child_, old, fresh);
  };
  for (size_t g = 0; g < from.groups.size(); ++g) {
    const ParameterGroup& group = from.groups[g];
    values(group.width, false, group.values, to.groups[g].values);
    values(group.width, true, group.exp_avg, to.groups[g].exp_avg);
    values(group.width, true, group.exp_avg_sq, to.groups[g].exp_avg_sq);
  }
  counts(from.rows.steps, to.rows.steps);
  counts(from.rows.refused, to.rows.refused);
  values(1, false, from.rows.pace, to.rows.pace);
  values(1, false, from.rows.reach, to.rows.reach);
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

  Parameters fresh(queue, count, p.specs);
  gather(queue, 1, p, fresh);
  fresh.more_specs = p.more_specs;
  for (size_t t = 0; t < p.more.size(); ++t) {
    const TableSpec& spec = p.more_specs[t];
    if (spec.keys == 0) {  // not the Gaussians' own
      fresh.more.push_back(std::move(p.more[t]));
      continue;
    }
    fresh.more.emplace_back(queue, spec.count(count), spec.groups);
    fresh.more.back().active = {0, 0};
    gather(queue, spec.keys, p.more[t], fresh.more.back());
  }
  p = std::move(fresh);
  motion.split(queue, p, child_, rule.split, seed);
  forget(queue, count);
}

}  // namespace gflow
