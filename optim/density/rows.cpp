// SPDX-License-Identifier: Apache-2.0
#include "optim/density/rows.hpp"

namespace gflow {

RowMover::RowMover(Queue& queue)
    : program_(queue, "rows.cl"),
      rows_gather_(program_, "rows_gather"),
      rows_gather_counts_(program_, "rows_gather_counts") {}

void RowMover::gather(Queue& queue, size_t keys, const Buffer<cl_uint>& source,
                      const Buffer<cl_uint>& child, const Table& from, Table& to) {
  const cl_uint k = cl_uint(keys), n = cl_uint(to.count / keys), old_n = cl_uint(from.count / keys);
  const auto values = [&](size_t width, bool only_old, const Buffer<float>& old,
                          Buffer<float>& fresh) {
    rows_gather_(queue, Range::over(to.count * width), k, n, old_n, cl_uint(width), int(only_old),
                 source, child, old, fresh);
  };
  const auto counts = [&](const Buffer<cl_uint>& old, Buffer<cl_uint>& fresh) {
    rows_gather_counts_(queue, Range::over(to.count), k, n, old_n, source, child, old, fresh);
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

void RowMover::move(Queue& queue, Parameters& p, size_t count, const Buffer<cl_uint>& source,
                    const Buffer<cl_uint>& child) {
  Parameters fresh(queue, count, p.specs);
  gather(queue, 1, source, child, p, fresh);
  std::vector<Table> keyed;
  for (size_t t = 0; t < p.more.size(); ++t) {
    const TableSpec& spec = p.more_specs[t];
    if (spec.keys == 0) continue;  // not the Gaussians' own
    keyed.emplace_back(queue, spec.count(count), spec.groups);
    keyed.back().active = {0, 0};
    gather(queue, spec.keys, source, child, p.more[t], keyed.back());
  }
  // Everything is there now: from here on nothing fails.
  fresh.more_specs = p.more_specs;
  auto next = keyed.begin();
  for (size_t t = 0; t < p.more.size(); ++t)
    fresh.more.push_back(std::move(p.more_specs[t].keys ? *next++ : p.more[t]));
  p = std::move(fresh);
}

}  // namespace gflow
