// SPDX-License-Identifier: Apache-2.0
// Adam for arrays of rows (one row per Gaussian, say) in which only some rows were seen. A row that
// was not seen keeps every bit, and each row has its own step count, so that a row seen seldom gets
// the bias correction of its own history.
#pragma once
#include <algorithm>
#include <string>

#include "runtime/kernel.hpp"
#include "shared/adam.h"

GFLOW_KERNEL_STRUCT(AdamStep);

namespace gflow {

struct AdamConfig {
  float beta1 = 0.9f;    // decay of the mean gradient, in [0, 1)
  float beta2 = 0.999f;  // decay of the mean squared gradient, in [0, 1)
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
  // Moments and gradients are zero, values undefined. Those of what does not learn are empty.
  ParameterGroup(Queue& queue, const std::string& name, size_t rows, size_t width,
                 bool learns = true);
  size_t width;
  Buffer<float> values, grads, exp_avg, exp_avg_sq;
};

// What all groups share, per row.
struct RowState {
  RowState(Queue& queue, size_t rows);  // nothing seen, no step made, none refused
  Buffer<cl_uint> seen;                 // 0: the row is not touched in this training step
  Buffer<cl_uint> steps;                // steps the row has made
  Buffer<cl_uint> refused;              // 1: had a gradient that Adam cannot take; never reset here
  Buffer<float> pace;                   // multiplies the row's learning rates; 1 unless changed
  Buffer<float> reach;                  // divides those of groups per time; 1 unless changed
  Buffer<float> rates{"rates"};         // [rows, 2] of the step that is being made, by advance()
};

// A training step is: refuse() for every group, advance() once, step() for every group.
// `rows` are those that may have been seen; the buffers may be longer.
class Adam {
 public:
  explicit Adam(Queue& queue, const AdamConfig& config = {});

  // Rows with a gradient in this group that is not finite (or whose square is not) become unseen
  // and refused, so that they are skipped in all groups.
  void refuse(Queue& queue, const ParameterGroup& group, RowState& state, RowRange rows);
  // Counts one step for the rows seen.
  void advance(Queue& queue, RowState& state, RowRange rows);
  // Moves the values of the rows seen against their gradients.
  void step(Queue& queue, ParameterGroup& group, const RowState& state, RowRange rows,
            AdamRate rate);

 private:
  AdamConfig config_;
  bool gpu_;
  Program program_;
  Kernel<cl_uint, cl_uint, cl_uint, In<float>, Out<cl_uint>, Out<cl_uint>> adam_refuse_;
  Kernel<cl_uint, cl_uint, cl_uint, In<float>, In<cl_uint>, In<float>, Out<cl_uint>, Out<float>>
      adam_advance_;
  Kernel<cl_uint, cl_uint, cl_uint, AdamStep, cl_int, In<float>, In<float>, In<float>, Out<float>,
         Out<float>, Out<float>>
      adam_step_;
  Buffer<float> corrections_;  // [table, 2] by step count
};

// The corrections c1, c2 of shared/adam.h at step t = 1, 2, ..., in double.
struct AdamCorrection {
  double c1, c2;
};
AdamCorrection adam_correction(const AdamConfig& config, double t);

}  // namespace gflow
