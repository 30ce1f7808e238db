// SPDX-License-Identifier: Apache-2.0
#include "optim/density/rows.hpp"

namespace gflow {

RowMover::RowMover(Queue& queue)
    : program_(queue, "common.cl"),
      rows_gather_(program_, "rows_gather"),
      rows_gather_counts_(program_, "rows_gather_counts"),
      rows_movers_(program_, "rows_dynamic"),
      rows_partition_(program_, "rows_partition"),
      scan_(queue) {}

void RowMover::gather(Queue& queue, const Parameters& p, size_t keys, const Buffer<cl_uint>& source,
                      const Buffer<cl_uint>& child, const Table& from, Table& to) {
  const cl_uint k = cl_uint(keys), n = cl_uint(to.count / keys), old_n = cl_uint(from.count / keys);
  const auto counts = [&](const Buffer<cl_uint>& old, Buffer<cl_uint>& fresh) {
    rows_gather_counts_(queue, Range::over(to.count), k, n, old_n, source, child, old, fresh);
  };
  for (size_t g = 0; g < from.groups.size(); ++g) {
    const GroupSpec& spec = from.specs[g];
    const ParameterGroup& group = from.groups[g];
    const size_t rows = to.rows_of(spec);
    const auto values = [&](bool only_old, const Buffer<float>& old, Buffer<float>& fresh) {
      const Buffer<float>& static_source =
          spec.static_source.empty() ? old : p[spec.static_source].values;
      rows_gather_(queue, Range::over(rows * spec.width), k, cl_uint(rows / keys),
                   cl_uint(from.rows_of(spec) / keys), cl_uint(spec.width), int(only_old),
                   spec.static_value, int(!spec.static_source.empty()), source, child, old,
                   static_source, fresh);
    };
    values(false, group.values, to.groups[g].values);
    if (group.remembers()) {
      to.groups[g].exp_avg.ensure(queue, rows * spec.width);
      values(true, group.exp_avg, to.groups[g].exp_avg);
    }
    values(true, group.exp_avg_sq, to.groups[g].exp_avg_sq);
  }
  counts(from.rows.steps, to.rows.steps);
  counts(from.rows.last, to.rows.last);
  to.rows.now = from.rows.now;
  counts(from.rows.rejected, to.rows.rejected);
  const auto factors = [&](const Buffer<float>& old, Buffer<float>& fresh) {
    rows_gather_(queue, Range::over(to.count), k, n, old_n, 1u, 0, 1.f, 0, source, child, old, old,
                 fresh);
  };
  factors(from.rows.rate_scale, to.rows.rate_scale);
  factors(from.rows.rate_divisor, to.rows.rate_divisor);
}

void RowMover::move(Queue& queue, Parameters& p, size_t count, Buffer<cl_uint>& source,
                    Buffer<cl_uint>& child, bool wakes) {
  if (p.moving == p.count) return rebuild(queue, p, count, count, source, child);
  moves_.ensure(queue, count);
  rows_movers_(queue, Range::over(count), cl_uint(count), cl_uint(p.moving), int(wakes), source,
               child, moves_);
  move(queue, p, count, moves_, source, child);
}

void RowMover::move(Queue& queue, Parameters& p, size_t count, const Buffer<cl_uint>& moves,
                    Buffer<cl_uint>& source, Buffer<cl_uint>& child) {
  scan_.exclusive(queue, moves, before_, count);
  sorted_source_.ensure(queue, count);
  sorted_child_.ensure(queue, count);
  rows_partition_(queue, Range::over(count), cl_uint(count), moves, before_, source, child,
                  sorted_source_, sorted_child_);
  rebuild(queue, p, count, size_t(scan_.total(queue)), sorted_source_, sorted_child_);
  std::swap(source, sorted_source_);
  std::swap(child, sorted_child_);
}

void RowMover::rebuild(Queue& queue, Parameters& p, size_t count, size_t moving,
                       const Buffer<cl_uint>& source, const Buffer<cl_uint>& child) {
  Parameters fresh(queue, count, p.specs, {}, moving);
  gather(queue, p, 1, source, child, p, fresh);
  std::vector<Table> keyed;
  for (size_t t = 0; t < p.more.size(); ++t) {
    const TableSpec& spec = p.more_specs[t];
    if (spec.keys == 0) continue;  // shared by all Gaussians
    const size_t rows = spec.count(moving);
    keyed.emplace_back(queue, rows, rows, spec.groups);
    keyed.back().active = {0, 0};
    gather(queue, p, spec.keys, source, child, p.more[t], keyed.back());
  }
  // All allocations are done: nothing below can fail.
  fresh.more_specs = p.more_specs;
  auto next = keyed.begin();
  for (size_t t = 0; t < p.more.size(); ++t)
    fresh.more.push_back(std::move(p.more_specs[t].keys ? *next++ : p.more[t]));
  p = std::move(fresh);
}

}  // namespace gflow
