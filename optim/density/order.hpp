// SPDX-License-Identifier: Apache-2.0
// Order of rows by time and place, so that the Gaussians of an image are adjacent: others share no
// cache lines with them, and whole vectors and work-groups are skipped.
#pragma once
#include "optim/density/rows.hpp"

namespace gflow {

// Row order: new row j is row order[j]. First the Gaussians that are visible through most of the
// video, then the others by temporal mean; each group along a Z curve in space (Morton 1966).
// Non-finite rows come last. means [N,3], means_t [N], log_scales [N,4]; duration: length of the
// video [model time]. A function of its arguments alone.
std::vector<uint32_t> order_of(const std::vector<float>& means, const std::vector<float>& means_t,
                               const std::vector<float>& log_scales, double duration);

class RowOrder {
 public:
  explicit RowOrder(Queue& queue) : rows_(queue) {}

  // Sorts the rows of all tables, dynamic before static. Returns the former row of each. Waits. If
  // it throws, `parameters` are unchanged.
  const Buffer<cl_uint>& sort(Queue& queue, Parameters& parameters, double duration);

 private:
  RowMover rows_;
  Buffer<cl_uint> source_{"source"}, child_{"child"};
};

}  // namespace gflow
