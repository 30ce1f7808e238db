// SPDX-License-Identifier: Apache-2.0
// Rows in the order of time and place, so that what a picture shows lies together: the others' rows
// share no cache lines with it, and whole vectors and work-groups have nothing to do.
#pragma once
#include "optim/density/rows.hpp"

namespace gflow {

// New row j of such an order is row order[j]: first those that last through most of the video, then
// by the moment they live at, each along a Z curve (Morton 1966) through space. means [N,3],
// means_t [N], log_scales [N,4]; duration: length of the video [model time]. What is not finite
// comes last. A function of its arguments alone.
std::vector<uint32_t> order_of(const std::vector<float>& means, const std::vector<float>& means_t,
                               const std::vector<float>& log_scales, double duration);

class RowOrder {
 public:
  explicit RowOrder(Queue& queue) : rows_(queue) {}

  // Puts the rows of all tables in that order, those that move before those that rest. Returns the
  // row that each was. Waits. If it throws, `parameters` are as they were.
  const Buffer<cl_uint>& sort(Queue& queue, Parameters& parameters, double duration);

 private:
  RowMover rows_;
  Buffer<cl_uint> source_{"source"}, child_{"child"};
};

}  // namespace gflow
