// SPDX-License-Identifier: Apache-2.0
// Moves, drops and copies the Gaussians' rows in every table. Kernels: kernels/rows.cl.
#pragma once
#include "optim/motion/parameters.hpp"
#include "runtime/primitives/scan.hpp"

namespace gflow {

class RowMover {
 public:
  explicit RowMover(Queue& queue);

  // Makes `count` Gaussians: the j-th gets the values of source[j], and its moments and step counts
  // unless child[j] > 0: then zeros. In tables with keys so do all its rows; tables that all
  // Gaussians share stay. Those that move are what moved and the children; where some rest, they
  // are put first, and source and child with them, and it waits. If this throws, `parameters` are
  // as they were.
  void move(Queue& queue, Parameters& parameters, size_t count, Buffer<cl_uint>& source,
            Buffer<cl_uint>& child);

  // The same, but moves[j] says whether the j-th moves (0: it rests), before they are put in order.
  // One that begins to move has the values of rest and zero moments in what only those that move
  // have.
  void move(Queue& queue, Parameters& parameters, size_t count, const Buffer<cl_uint>& moves,
            Buffer<cl_uint>& source, Buffer<cl_uint>& child);

 private:
  // Fills a table with `keys` rows a Gaussian from the one that `parameters` had.
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
  Kernel<cl_uint, cl_uint, In<cl_uint>, In<cl_uint>, Out<cl_uint>> rows_movers_;
  Kernel<cl_uint, In<cl_uint>, In<cl_uint>, In<cl_uint>, In<cl_uint>, Out<cl_uint>, Out<cl_uint>>
      rows_partition_;
  Scan scan_;
  Buffer<cl_uint> moves_{"moves"}, before_{"movers before"};
  Buffer<cl_uint> sorted_source_{"source"}, sorted_child_{"child"};
};

}  // namespace gflow
