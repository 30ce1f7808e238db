// SPDX-License-Identifier: Apache-2.0
// Stable radix sort of (key, value) pairs of unsigned integers on the device.
#pragma once
#include "runtime/primitives/scan.hpp"

namespace gflow {

// Least significant digit first: 11-bit digits on CPUs, where a work-item has counts of its own,
// 8-bit digits elsewhere. Keeps scratch memory of the size of the longest input.
class RadixSort {
 public:
  explicit RadixSort(Queue& queue);

  // Sorts the first n pairs by the low `bits` bits of their keys, ascending; pairs with equal bits
  // keep their order. Elements from n on are undefined afterwards. Does not wait.
  void sort(Queue& queue, Buffer<cl_uint>& keys, Buffer<cl_uint>& values, size_t n, int bits = 32);

 private:
  int group_, digit_bits_;
  Program program_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_uint, In<cl_uint>, Out<cl_uint>> sort_count_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_uint, In<cl_uint>, In<cl_uint>, In<cl_uint>, Out<cl_uint>,
         Out<cl_uint>>
      sort_scatter_;
  Scan scan_;
  Buffer<cl_uint> counts_;   // [digits, chunks]
  Buffer<cl_uint> offsets_;  // [digits * chunks + 1]
  Buffer<cl_uint> other_keys_, other_values_;
};

}  // namespace gflow
