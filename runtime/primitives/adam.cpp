// SPDX-License-Identifier: Apache-2.0
// Bias corrections and decays come from a table computed in double: 1 - beta2^t in float is off by
// up to 7e-6, and a power per scalar is slow.
#include "runtime/primitives/adam.hpp"

#include <algorithm>
#include <cmath>

#include "shared/work.h"

namespace gflow {
namespace {

// Entries of the table; later steps use the last one. .999^32767 = 6e-15, so there both corrections
// are 1 in float and older moments no longer matter. Betas nearer to 1 are rejected.
const size_t table_size = 32768;

std::vector<float> rows_by_steps(const AdamConfig& config) {
  for (const float beta : {config.beta1, config.beta2})
    if (!(beta >= 0 && beta < 1) || std::pow(double(beta), table_size - 1) > 1e-8)
      throw Error(fmt::format("Adam's beta is {}; it must be in [0, 0.9994]", beta));
  std::vector<float> table;
  for (size_t t = 0; t < table_size; ++t) {
    const AdamRow row = adam_row(config, double(std::max<size_t>(t, 1)), double(t));
    for (const double factor : {row.correction1, row.correction2, row.decay1, row.decay2})
      table.push_back(float(factor));
  }
  return table;
}

Buffer<float> zeros(Queue& queue, size_t size, const std::string& name) {
  Buffer<float> buffer(queue, size, name);
  buffer.fill(queue, 0);
  return buffer;
}

Buffer<cl_uint> no_rows(Queue& queue, size_t rows, const std::string& name) {
  Buffer<cl_uint> buffer(queue, rows, name);
  buffer.fill(queue, 0);
  return buffer;
}

void check_rows(const ParameterGroup& group, const RowState& state, const RowRange& rows) {
  const size_t end = rows.first + rows.count, values = end * group.width;
  if (values <= group.values.size() && values <= group.grads.size() &&
      values <= group.exp_avg_sq.size() && end <= state.seen.size() && end <= state.steps.size() &&
      end <= state.last.size() && end <= state.rejected.size())
    return;
  throw Error(fmt::format("Adam: {} rows of {} values in {} exceed the length of its arrays", end,
                          group.width, group.values.name()));
}

// Work-items for so many rows on a CPU.
size_t spans(size_t rows) { return (rows + ADAM_SPAN - 1) / ADAM_SPAN; }

}  // namespace

AdamRow adam_row(const AdamConfig& config, double t, double missed) {
  const double beta1 = config.beta1, beta2 = config.beta2;
  return {1 / (1 - std::pow(beta1, t)), 1 / std::sqrt(1 - std::pow(beta2, t)),
          std::pow(beta1, missed), std::pow(beta2, missed)};
}

ParameterGroup::ParameterGroup(Queue& queue, const std::string& name, size_t rows, size_t width,
                               bool learns)
    : width(width),
      values(queue, rows * width, name),
      grads(zeros(queue, learns ? rows * width : 0, name + " grads")),
      exp_avg(name + " exp_avg"),
      exp_avg_sq(zeros(queue, learns ? rows * width : 0, name + " exp_avg_sq")) {}

void ParameterGroup::remember(Queue& queue) {
  if (exp_avg.size() != exp_avg_sq.size())
    exp_avg = zeros(queue, exp_avg_sq.size(), exp_avg.name());
}

RowState::RowState(Queue& queue, size_t rows)
    : seen(no_rows(queue, rows, "seen")),
      steps(no_rows(queue, rows, "steps")),
      last(no_rows(queue, rows, "last")),
      rejected(no_rows(queue, rows, "refused")),
      rate_scale(queue, rows, "pace"),
      rate_divisor(queue, rows, "reach") {
  rate_scale.fill(queue, 1.f);
  rate_divisor.fill(queue, 1.f);
}

Adam::Adam(Queue& queue, const AdamConfig& config)
    : config_(config),
      gpu_(queue.lanes == 1),
      program_(queue, "common.cl"),
      adam_refuse_(program_, "adam_refuse"),
      adam_advance_(program_, "adam_advance"),
      adam_step_(program_, "adam_step"),
      table_(queue, rows_by_steps(config), "adam table") {}

void Adam::refuse(Queue& queue, const ParameterGroup& group, RowState& state, RowRange rows) {
  check_rows(group, state, rows);
  adam_refuse_(queue, Range::over(gpu_ ? rows.count : spans(rows.count)), cl_uint(rows.first),
               cl_uint(rows.count), cl_uint(group.width), group.grads, state.seen, state.rejected);
}

void Adam::advance(Queue& queue, RowState& state, RowRange rows) {
  state.rates.ensure(queue, 4 * state.steps.size());
  state.idle.ensure(queue, spans(state.steps.size()));
  ++state.now;
  adam_advance_(queue, Range::over(gpu_ ? rows.count : spans(rows.count)), cl_uint(rows.first),
                cl_uint(rows.count), state.now, cl_int(config_.makes_up), cl_uint(table_size),
                table_, state.seen, state.rate_scale, state.steps, state.last, state.rejected,
                state.rates, state.idle);
}

void Adam::step(Queue& queue, ParameterGroup& group, const RowState& state, RowRange rows,
                AdamRate rate) {
  check_rows(group, state, rows);
  if (config_.beta1 > 0) group.remember(queue);
  const AdamStep step{config_.beta1, config_.beta2, rate.lr, rate.epsilon};
  adam_step_(queue, Range::over(gpu_ ? rows.count * group.width : spans(rows.count)),
             cl_uint(rows.first), cl_uint(rows.count), cl_uint(group.width), step, rate.per_time,
             state.rates, state.idle, state.rate_divisor, group.grads, group.values, group.exp_avg,
             group.exp_avg_sq);
}

}  // namespace gflow
