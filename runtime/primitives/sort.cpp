// SPDX-License-Identifier: Apache-2.0
// One count, prefix sum and scatter per digit; see kernels/primitives/sort.cl.
#include "runtime/primitives/sort.hpp"

#include "runtime/cl/chunks.hpp"
#include "shared/work.h"

namespace gflow {

RadixSort::RadixSort(Queue& queue)
    : group_(chunk_group(queue)),
      digit_bits_(SORT_BITS(group_)),
      program_(queue, "common.cl"),
      sort_count_(program_, "sort_count"),
      sort_scatter_(program_, "sort_scatter"),
      scan_(queue),
      counts_("sort counts"),
      offsets_("sort offsets"),
      other_keys_("sort keys"),
      other_values_("sort values") {}

void RadixSort::sort(Queue& queue, Buffer<cl_uint>& keys, Buffer<cl_uint>& values, size_t n,
                     int bits) {
  if (n > keys.size() || n > values.size())
    throw Error(fmt::format("sorting {} pairs of {}, which has {}, and {}, which has {}", n,
                            keys.name(), keys.size(), values.name(), values.size()));
  if (bits < 0 || bits > 32) throw Error(fmt::format("sorting by {} bits; keys have 32", bits));
  if (n < 2) return;
  // A chunk's counts are read and written as a whole, so a chunk should have more keys than digits.
  const Chunks chunks = chunks_for(queue, n, group_ == 1 ? 8192 : 1024);
  const size_t entries = size_t(chunks.count) << digit_bits_;
  counts_.ensure(queue, entries);
  other_keys_.ensure(queue, keys.size());
  other_values_.ensure(queue, values.size());
  const Range range = Range::groups(chunks.count, size_t(group_));
  for (int shift = 0; shift < bits; shift += digit_bits_) {
    const cl_uint mask = (1u << std::min(digit_bits_, bits - shift)) - 1;
    sort_count_(queue, range, cl_uint(n), chunks.length, cl_uint(shift), mask, keys, counts_);
    scan_.exclusive(queue, counts_, offsets_, entries);
    sort_scatter_(queue, range, cl_uint(n), chunks.length, cl_uint(shift), mask, keys, values,
                  offsets_, other_keys_, other_values_);
    keys.swap_memory(other_keys_);
    values.swap_memory(other_values_);
  }
}

}  // namespace gflow
