// SPDX-License-Identifier: Apache-2.0
// Sums over long arrays, bitwise repeatable. They wait for the device: for logging and decisions,
// not for every step.
#pragma once
#include "runtime/cl/kernel.hpp"

namespace gflow {

class Reduce {
 public:
  explicit Reduce(Queue& queue);

  // Sum of all elements, or of values[first] .. values[first + count - 1]. Blocks of 256 are
  // summed pairwise in float, the blocks in double.
  double sum(Queue& queue, const Buffer<float>& values);
  double sum(Queue& queue, const Buffer<float>& values, size_t first, size_t count);

  // Number of elements larger than `than`.
  uint64_t count_above(Queue& queue, const Buffer<cl_uint>& values, cl_uint than);
  uint64_t count_nonzero(Queue& queue, const Buffer<cl_uint>& values) {
    return count_above(queue, values, 0);
  }

 private:
  Program program_;
  Kernel<cl_uint, cl_uint, In<float>, Out<float>> reduce_sum_;
  Kernel<cl_uint, cl_uint, cl_uint, In<cl_uint>, Out<cl_uint>> reduce_count_;
  Buffer<float> partial_sums_;      // [blocks]
  Buffer<cl_uint> partial_counts_;  // [blocks]
};

}  // namespace gflow
