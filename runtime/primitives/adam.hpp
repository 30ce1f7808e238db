// SPDX-License-Identifier: Apache-2.0
// Adam for arrays of rows (e.g. one per Gaussian), of which only some are seen in a step. A row
// that is not seen keeps every bit. When it is seen again, its moments decay as if its gradient had
// been 0 meanwhile. With beta1 = 0 the result is, up to rounding, that of stepping all rows, since
// a gradient of 0 moves nothing. With beta1 > 0 the motion by the decaying mean gradient during
// missed steps is left out.
#pragma once
#include <algorithm>
#include <string>

#include "runtime/cl/kernel.hpp"
#include "shared/adam.h"

GFLOW_KERNEL_STRUCT(AdamStep);

namespace gflow {

struct AdamConfig {
  float beta1 = 0.9f;    // decay of the mean gradient, in [0, 1)
  float beta2 = 0.999f;  // decay of the mean squared gradient, in [0, 1)
  bool makes_up = true;  // false: missed steps do not count
};

// Learning rate and noise floor of one parameter group in one training step.
struct AdamRate {
  float lr;          // step length in units of the parameter
  float epsilon;     // gradients well below it do not move the parameter
  int per_time = 0;  // the row's rate is lr * rate_scale / rate_divisor^per_time
};

// Rows first, first + 1, ...; a number alone means that many rows from 0 on.
struct RowRange {
  RowRange(size_t count) : RowRange(0, count) {}
  RowRange(size_t first, size_t count) : first(first), count(count) {}
  // The smallest range that contains both.
  RowRange joined(const RowRange& other) const {
    if (count == 0) return other;
    if (other.count == 0) return *this;
    const size_t from = std::min(first, other.first);
    return {from, std::max(first + count, other.first + other.count) - from};
  }
  size_t first, count;
};

// One parameter array with its gradients and Adam's moments, all [rows, width].
struct ParameterGroup {
  // Gradients and exp_avg_sq start at zero, values are undefined. If `learns` is false, gradients
  // and moments are empty. exp_avg is empty until a step with beta1 > 0.
  ParameterGroup(Queue& queue, const std::string& name, size_t rows, size_t width,
                 bool learns = true);
  bool remembers() const { return exp_avg.size() > 0; }
  void remember(Queue& queue);  // allocates exp_avg as 0, unless it is there

  size_t width;
  Buffer<float> values, grads, exp_avg, exp_avg_sq;
};

// State that all groups share, per row.
struct RowState {
  RowState(Queue& queue, size_t rows);  // nothing seen, no steps, none rejected
  Buffer<cl_uint> seen;                 // 0: the row is skipped in this training step
  Buffer<cl_uint> steps;  // from its first gradient to its last step, with missed ones
  Buffer<cl_uint> last;   // number of its last step, if steps > 0
  // 0: all gradients finite; 1: some rejected; k + 1: last k rejected.
  Buffer<cl_uint> rejected;
  Buffer<float> rate_scale;       // learning-rate scale; 1 unless changed
  Buffer<float> rate_divisor;     // divides the rates of groups per time; 1 unless changed
  Buffer<float> rates{"rates"};   // [rows, 4] AdamRow of the current step, by advance()
  Buffer<cl_uchar> idle{"idle"};  // CPUs: [spans of rows] 1: no row is seen (shared/work.h)
  cl_uint now = 0;                // steps made so far, by any row
};

// A training step is: refuse() for every group, advance() once, step() for every group.
// `rows` are those that may have been seen; the buffers may be longer.
class Adam {
 public:
  explicit Adam(Queue& queue, const AdamConfig& config = {});

  // Rejects rows with a gradient in this group that is not finite (or whose square is not): they
  // become unseen, so that all groups skip them.
  void refuse(Queue& queue, const ParameterGroup& group, RowState& state, RowRange rows);
  // Begins a step. Counts it, and the steps missed since its last one, for each seen row.
  void advance(Queue& queue, RowState& state, RowRange rows);
  // Moves the values of seen rows against their gradients. `rows` must begin as in advance().
  void step(Queue& queue, ParameterGroup& group, const RowState& state, RowRange rows,
            AdamRate rate);

 private:
  AdamConfig config_;
  bool gpu_;
  Program program_;
  Kernel<cl_uint, cl_uint, cl_uint, In<float>, Out<cl_uint>, Out<cl_uint>> adam_refuse_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_int, cl_uint, In<float>, In<cl_uint>, In<float>,
         Out<cl_uint>, Out<cl_uint>, Out<cl_uint>, Out<float>, Out<cl_uchar>>
      adam_advance_;
  Kernel<cl_uint, cl_uint, cl_uint, AdamStep, cl_int, In<float>, In<cl_uchar>, In<float>, In<float>,
         Out<float>, Out<float>, Out<float>>
      adam_step_;
  Buffer<float> table_;  // [table, 4] AdamRow by steps
};

// The factors of shared/adam.h, in double: corrections at step t = 1, 2, ... of a row, and decays
// of `missed` steps.
AdamRow adam_row(const AdamConfig& config, double t, double missed);

}  // namespace gflow
