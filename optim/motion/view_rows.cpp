// SPDX-License-Identifier: Apache-2.0
#include "optim/motion/view_rows.hpp"

#include <numeric>

namespace gflow {

In<cl_uint> RowList::buffer() const {
  static const Buffer<cl_uint> none;
  return rows ? *rows : none;
}

ViewRows::ViewRows(Queue& queue)
    : program_(queue, "common.cl"),
      view_rows_write_(program_, "view_rows_write"),
      scan_(queue),
      found_(queue, 2, "rows found") {}

void ViewRows::take_all(const Parameters& p) {
  listed_ = false;
  count_ = p.count;
  moving_ = p.moving;
}

void ViewRows::ensure_marks(Queue& queue, const Parameters& p) {
  const size_t lanes = size_t(queue.lanes);
  marks.ensure(queue, (p.count + lanes - 1) / lanes);
  counts.ensure(queue, marks.size());
}

void ViewRows::take_marked(Queue& queue, const Parameters& p) {
  listed_ = true;
  count_ = moving_ = 0;
  if (p.count == 0) return;
  rows_.ensure(queue, p.count);
  scan_.exclusive(queue, counts, offsets_, groups());
  view_rows_write_(queue, Range::over(groups()), cl_uint(groups()), cl_uint(p.moving), marks,
                   offsets_, rows_, found_);
  const std::vector<cl_uint> found = found_.read(queue);
  count_ = found[0];
  moving_ = found[1];
}

std::vector<cl_uint> ViewRows::read(Queue& queue) const {
  if (listed_) return rows_.read_range(queue, 0, count_);
  std::vector<cl_uint> rows(count_);
  std::iota(rows.begin(), rows.end(), 0u);
  return rows;
}

}  // namespace gflow
