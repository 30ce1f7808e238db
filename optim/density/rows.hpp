// SPDX-License-Identifier: Apache-2.0
// Moves, drops and copies the Gaussians' rows in every table. Kernels: kernels/rows.cl.
#pragma once
#include "optim/motion/parameters.hpp"

namespace gflow {

class RowMover {
 public:
  explicit RowMover(Queue& queue);

  // Makes `count` Gaussians: the j-th gets the values of source[j], and its moments and step counts
  // unless child[j] > 0: then zeros. In tables with keys so do all its rows; tables that all
  // Gaussians share stay. If this throws, `parameters` are as they were.
  void move(Queue& queue, Parameters& parameters, size_t count, const Buffer<cl_uint>& source,
            const Buffer<cl_uint>& child);

 private:
  // Rows of a table with `keys` rows a Gaussian.
  void gather(Queue& queue, size_t keys, const Buffer<cl_uint>& source,
              const Buffer<cl_uint>& child, const Table& from, Table& to);

  Program program_;
  Kernel<cl_uint, cl_uint, cl_uint, cl_uint, cl_int, In<cl_uint>, In<cl_uint>, In<float>,
         Out<float>>
      rows_gather_;
  Kernel<cl_uint, cl_uint, cl_uint, In<cl_uint>, In<cl_uint>, In<cl_uint>, Out<cl_uint>>
      rows_gather_counts_;
};

}  // namespace gflow
