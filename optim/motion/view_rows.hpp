// SPDX-License-Identifier: Apache-2.0
// Culling: the rows of a model that a view may show. Gaussians of other times and outside the image
// are dropped before they are posed. All other arrays of the view have one entry per listed row, in
// the same order (Skips::culled).
#pragma once
#include "optim/motion/parameters.hpp"
#include "runtime/primitives/scan.hpp"

namespace gflow {

// Rows of a view, as the kernels take them (kernels/shared/view_rows.h).
struct RowList {
  size_t count = Parameters::all;         // entries, at most as many as rows
  const Buffer<cl_uint>* rows = nullptr;  // [count] ascending; nullptr: entry k is row k

  size_t count_of(const Parameters& p) const { return std::min(count, p.count); }
  In<cl_uint> buffer() const;
};

class ViewRows {
 public:
  explicit ViewRows(Queue& queue);

  // Every row of the model.
  void take_all(const Parameters& parameters);
  // The marked rows. Waits, because their number decides how much work is queued.
  void take_marked(Queue& queue, const Parameters& parameters);

  RowList list() const { return {count_, listed_ ? &rows_ : nullptr}; }
  size_t count() const { return count_; }
  // Number of dynamic rows; they come first, as in the model.
  size_t moving() const { return moving_; }
  // The row of each entry. Waits.
  std::vector<cl_uint> read(Queue& queue) const;

  // For Motion::cull: one bit per row in groups of queue.lanes rows, and the number of set bits.
  void ensure_marks(Queue& queue, const Parameters& parameters);
  size_t groups() const { return marks.size(); }
  Buffer<cl_uint> marks{"marks"}, counts{"marked"};  // [groups]

 private:
  Program program_;
  Kernel<cl_uint, cl_uint, In<cl_uint>, In<cl_uint>, Out<cl_uint>, Out<cl_uint>> view_rows_write_;
  Scan scan_;
  Buffer<cl_uint> offsets_{"marked before"}, rows_{"rows of the view"}, found_{"rows found"};
  bool listed_ = false;
  size_t count_ = 0, moving_ = 0;
};

}  // namespace gflow
