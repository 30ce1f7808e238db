// SPDX-License-Identifier: Apache-2.0
// Adam for arrays of rows (one row per Gaussian, say) in which only some rows were seen. A row that
// was not seen keeps every bit. When it is seen again, its moments have decayed as if its gradient
// had been 0 meanwhile. With beta1 = 0 a gradient of 0 moves nothing, so the result is that of
// steps for all rows, but for rounding; with beta1 > 0 what the mean gradient would have gone on to
// do meanwhile is left out.
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
  bool makes_up = true;  // false: steps that a row missed never were
};

// Step size and noise floor of one parameter group at one training step.
struct AdamRate {
  float lr;          // the step's length in units of the parameter
  float epsilon;     // gradients well below it do not move the parameter
  int per_time = 0;  // the row's rate is lr * pace / reach^per_time
};

// Rows first, first + 1, ...; a number alone means that many from the first on.
struct RowRange {
  RowRange(size_t count) : RowRange(0, count) {}
  RowRange(size_t first, size_t count) : first(first), count(count) {}
  // The smallest range that holds both.
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
  // Gradients and exp_avg_sq are zero, values undefined. Those of what does not learn are empty,
  // and so is exp_avg until a step with beta1 > 0.
  ParameterGroup(Queue& queue, const std::string& name, size_t rows, size_t width,
                 bool learns = true);
  bool remembers() const { return exp_avg.size() > 0; }
  void remember(Queue& queue);  // exp_avg 0, unless it is there

  size_t width;
  Buffer<float> values, grads, exp_avg, exp_avg_sq;
};

// What all groups share, per row.
struct RowState {
  RowState(Queue& queue, size_t rows);  // nothing seen, no step made, none refused
  Buffer<cl_uint> seen;                 // 0: the row is not touched in this training step
  Buffer<cl_uint> steps;  // from its first gradient up to its last step, missed ones too
  Buffer<cl_uint> last;   // number of its last step, if steps > 0
  // 0: Adam could take all its gradients; 1: not all; k + 1: none of its last k.
  Buffer<cl_uint> refused;
  Buffer<float> pace;             // multiplies the row's learning rates; 1 unless changed
  Buffer<float> reach;            // divides those of groups per time; 1 unless changed
  Buffer<float> rates{"rates"};   // [rows, 4] of the step that is being made, by advance(), and on
  Buffer<cl_uchar> idle{"idle"};  // CPUs which spans of rows (shared/work.h) have none that is seen
  cl_uint now = 0;                // steps made so far, by any row
};

// A training step is: refuse() for every group, advance() once, step() for every group.
// `rows` are those that may have been seen; the buffers may be longer.
class Adam {
 public:
  explicit Adam(Queue& queue, const AdamConfig& config = {});

  // Rows with a gradient in this group that is not finite (or whose square is not) become unseen
  // and refused, so that they are skipped in all groups.
  void refuse(Queue& queue, const ParameterGroup& group, RowState& state, RowRange rows);
  // Begins a step and counts it, and those missed since its last one, for each row seen.
  void advance(Queue& queue, RowState& state, RowRange rows);
  // Moves the values of the rows seen against their gradients; `rows` from the same first one as
  // in advance().
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

// shared/adam.h: the corrections at step t = 1, 2, ... of a row, in double, and the decays of so
// many steps missed.
AdamRow adam_row(const AdamConfig& config, double t, double missed);

}  // namespace gflow
