// SPDX-License-Identifier: Apache-2.0
// First stage on the device (kernels/primitives/reduce.cl), second here, in order.
#include "runtime/primitives/reduce.hpp"

#include <numeric>

namespace gflow {
namespace {

// Blocks of 256 elements: BLOCK of kernels/primitives/reduce.cl.
size_t blocks_of(size_t size, size_t first, size_t count, const std::string& name) {
  if (first > size || count > size - first || size >= size_t(1) << 32)
    throw Error(fmt::format("summing {} elements from element {} of {}, which has {}", count, first,
                            name, size));
  return (count + 255) / 256;
}

}  // namespace

Reduce::Reduce(Queue& queue)
    : program_(queue, "common.cl"),
      reduce_sum_(program_, "reduce_sum"),
      reduce_count_(program_, "reduce_count"),
      partial_sums_("partial sums"),
      partial_counts_("partial counts") {}

double Reduce::sum(Queue& queue, const Buffer<float>& values) {
  return sum(queue, values, 0, values.size());
}

double Reduce::sum(Queue& queue, const Buffer<float>& values, size_t first, size_t count) {
  const size_t blocks = blocks_of(values.size(), first, count, values.name());
  partial_sums_.ensure(queue, blocks);
  reduce_sum_(queue, Range::over(blocks), cl_uint(first), cl_uint(count), values, partial_sums_);
  const auto partial = partial_sums_.read(queue);
  return std::accumulate(partial.begin(), partial.end(), 0.0);
}

uint64_t Reduce::count_above(Queue& queue, const Buffer<cl_uint>& values, cl_uint than) {
  const size_t count = values.size(), blocks = blocks_of(count, 0, count, values.name());
  partial_counts_.ensure(queue, blocks);
  reduce_count_(queue, Range::over(blocks), 0u, cl_uint(count), than, values, partial_counts_);
  const auto partial = partial_counts_.read(queue);
  return std::accumulate(partial.begin(), partial.end(), uint64_t(0));
}

}  // namespace gflow
