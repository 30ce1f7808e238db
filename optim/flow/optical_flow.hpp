// SPDX-License-Identifier: Apache-2.0
// The flow that teaches: OpenCV's DIS at its finest setting, with a forward-backward check that
// says where it can be trusted.
#pragma once
#include <cstdint>
#include <utility>
#include <vector>

#include "optim/formats/flo.hpp"
#include "optim/images/image.hpp"

namespace gflow {

// A flow and where to believe it.
struct TeacherFlow {
  FlowField flow;
  std::vector<uint8_t> confidence;  // [height, width] 255 consistent, 0 not or unknown
  float emphasis = 1;               // what each of its pixels counts as
};

// DIS flow from picture a to b (RGB, same size): finest scale 0, patch 8, stride 1, 100 gradient
// descent and 30 variational iterations. Takes one core; the same on any number of them.
FlowField estimate_flow(const Image& a, const Image& b);

// 255 where |f(x) + b(x + f(x))| < max(0.5 px, 5 % of |f|), b bilinear; 0 elsewhere, where f leaves
// the picture, and where f is not valid.
std::vector<uint8_t> consistency(const FlowField& forward, const FlowField& backward);

// Both of the above for one pair of pictures, from a to b and from b to a.
std::pair<TeacherFlow, TeacherFlow> estimate_teacher_flows(const Image& a, const Image& b);
// From a to b only.
TeacherFlow estimate_teacher_flow(const Image& a, const Image& b);

// The flow on a smaller or larger grid, vectors scaled along; the nearest sample, because a mean
// across a silhouette is the motion of nothing.
TeacherFlow resized(const TeacherFlow& teacher, int width, int height);

}  // namespace gflow
