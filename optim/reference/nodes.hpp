// SPDX-License-Identifier: Apache-2.0
// The nodes model in double, written from its formulas (shared/motion/nodes.h).
#pragma once
#include <algorithm>
#include <cmath>
#include <numeric>

#include "optim/motion/models.hpp"
#include "optim/reference/hexplane.hpp"
#include "optim/reference/parameters.hpp"
#include "shared/motion/nodes.h"

namespace gflow::reference {

// The pose of node k at a time.
inline BasisPose node_pose_at(const MotionShape& shape, const Named& p, size_t k, double t) {
  const real3 place = row3(p.at("node_places"), k);
  const std::vector<double> o =
      hexplane_layers(shape.hexplane, double(shape.duration), p, {place.x, place.y, place.z}, t)
          .back();
  const auto& h = shape.hexplane.half_size;
  return {quat_normalize({1 + o[3], o[4], o[5], o[6]}).q,
          {double(h[0]) * o[0], double(h[1]) * o[1], double(h[2]) * o[2]},
          place};
}

// The nodes of a place, nearest first.
inline std::vector<size_t> nearest_nodes(const Named& p, real3 m) {
  const auto squared = [&](size_t k) {
    const real3 arm = m - row3(p.at("node_places"), k);
    return dot(arm, arm);
  };
  std::vector<size_t> order(p.at("node_log_radii").size());
  std::iota(order.begin(), order.end(), size_t(0));
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return squared(a) < squared(b); });
  return order;
}

// A Gaussian that follows its nearest nodes.
inline Canonical followed(const MotionShape& shape, const Named& p, Canonical g, double t) {
  const std::vector<size_t> near = nearest_nodes(p, g.mean);
  double sum = 0, weights[NODE_NEIGHBOURS];
  for (size_t k = 0; k < NODE_NEIGHBOURS; ++k) {
    const real3 arm = g.mean - row3(p.at("node_places"), near[k]);
    const double radius = std::exp(p.at("node_log_radii")[near[k]]);
    sum += weights[k] = std::exp(-dot(arm, arm) / (2 * radius * radius));
  }
  real3 shift{0, 0, 0};
  real4 turn{0, 0, 0, 0};
  for (size_t k = 0; k < NODE_NEIGHBOURS; ++k) {
    const BasisPose pose = node_pose_at(shape, p, near[k], t);
    shift = shift + basis_shift(pose, g.mean) * (weights[k] / sum);
    turn = turn + basis_turn(pose) * (weights[k] / sum);
  }
  return blended(g, shift, turn);
}

// The rigidity of all nodes at a time: the mean over nodes and their NODE_NEIGHBOURS nearest others
// of the squared strain relative to the squared distance at rest.
inline double node_rigidity(const MotionShape& shape, const Named& p, double t) {
  const size_t nodes = p.at("node_log_radii").size();
  double sum = 0;
  for (size_t a = 0; a < nodes; ++a) {
    const BasisPose own = node_pose_at(shape, p, a, t);
    const std::vector<size_t> near = nearest_nodes(p, own.pivot);
    for (size_t j = 1; j <= NODE_NEIGHBOURS; ++j) {  // the nearest one is itself
      const BasisPose other = node_pose_at(shape, p, near[j], t);
      const real3 arm = other.pivot - own.pivot;
      const real3 strain = basis_shift(own, other.pivot) - other.shift;
      sum += dot(strain, strain) / dot(arm, arm);
    }
  }
  return sum / double(nodes * NODE_NEIGHBOURS);
}

}  // namespace gflow::reference
