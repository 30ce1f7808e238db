// SPDX-License-Identifier: Apache-2.0
// Where the nodes of the model "nodes" rest: far apart at first, later where Gaussians need them.
#pragma once
#include "optim/motion/models.hpp"

namespace gflow {

// Puts nodes at Gaussians of [first, end) that are far apart from each other, with the mean
// distance to the nearest other nodes as radius.
void place_nodes(const MotionShape& shape, HostGroups& groups, size_t first, size_t end);

// Nodes at rest.
struct NodePlaces {
  std::vector<float> places;     // [nodes, 3]
  std::vector<float> log_radii;  // [nodes]
};

// Moves idle nodes, which carry next to no Gaussians, beside those that carry most: density control
// adds Gaussians where images are wrong, so nodes follow the error. The field gives a node its path
// wherever it rests. Sorts nodes by place. Returns the row that each new row comes from; for a
// moved node, that of the node it relieves. means [n, 3] of the Gaussians
// that follow nodes.
std::vector<size_t> relieve_nodes(const std::vector<float>& means, NodePlaces& nodes);

}  // namespace gflow
