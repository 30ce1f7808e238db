// SPDX-License-Identifier: Apache-2.0
// Moves, drops and copies rows of Gaussians in every table. Kernels: kernels/density/rows.cl.
#pragma once
#include "optim/motion/parameters.hpp"
#include "runtime/primitives/scan.hpp"

namespace gflow {

class RowMover {
 public:
  explicit RowMover(Queue& queue);

  // Makes `count` Gaussians. The j-th gets the values of row source[j], and its moments and step
  // counts if child[j] is 0, else zeros; likewise its rows in tables with keys. Tables shared by
  // all Gaussians stay. Copies of dynamic rows are dynamic, and if `wakes`, all children. If some
  // are static, dynamic ones are sorted to the front, `source` and `child` with them, and it waits.
  // If it throws, `parameters` are unchanged.
  void move(Queue& queue, Parameters& parameters, size_t count, Buffer<cl_uint>& source,
            Buffer<cl_uint>& child, bool wakes);

  // The same, with moves[j] > 0 if the j-th is dynamic, in the order before sorting. A Gaussian
  // that becomes dynamic gets the static values and zero moments in its motion rows.
  void move(Queue& queue, Parameters& parameters, size_t count, const Buffer<cl_uint>& moves,
            Buffer<cl_uint>& source, Buffer<cl_uint>& child);

 private:
  // Fills a table with `keys` rows per Gaussian from the corresponding one of `parameters`.
  void gather(Queue& queue, const Parameters& parameters, size_t keys,
              const Buffer<cl_uint>& source, const Buffer<cl_uint>& child, const Table& from,
              Table& to);
  void rebuild(Queue& queue, Parameters& parameters, size_t count, size_t moving,
               const Buffer<cl_uint>& source, const Buffer<cl_uint>& child);

  Program program_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_uint, cl_int, cl_float, cl_int, In<cl_uint>, In<cl_uint>,
         In<float>, In<float>, Out<float>>
      rows_gather_;
  Kernel<cl_uint, cl_uint, cl_uint, In<cl_uint>, In<cl_uint>, In<cl_uint>, Out<cl_uint>>
      rows_gather_counts_;
  Kernel<cl_uint, cl_uint, cl_int, In<cl_uint>, In<cl_uint>, Out<cl_uint>> rows_movers_;
  Kernel<cl_uint, In<cl_uint>, In<cl_uint>, In<cl_uint>, In<cl_uint>, Out<cl_uint>, Out<cl_uint>>
      rows_partition_;
  Scan scan_;
  Buffer<cl_uint> moves_{"moves"}, before_{"movers before"};
  Buffer<cl_uint> sorted_source_{"source"}, sorted_child_{"child"};
};

}  // namespace gflow
