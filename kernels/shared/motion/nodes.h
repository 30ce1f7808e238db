// SPDX-License-Identifier: Apache-2.0
// The nodes model (SC-GS, Huang et al. 2024; embedded deformation, Sumner et al. 2007): a few nodes
// move, and every Gaussian follows the NODE_NEIGHBOURS nearest ones. Node k rests at p_k with the
// radius r_k. At a time it turns by a unit quaternion and shifts, so that it is a basis (bases.h)
// with the pivot p_k. A Gaussian with the
// canonical mean m blends the poses of its nearest nodes with the weights
//   a_k = exp(-e_k) / sum_j exp(-e_j),   e_k = |m - p_k|^2 / (2 r_k^2)
// The output o of the field at p_k (hexplane.h) turns node k by (1 0 0 0) + o[3..6], normalised,
// and shifts it by half_size o[0..2].
#ifndef GFLOW_NODES_H
#define GFLOW_NODES_H
#include "shared/motion/bases.h"
#include "shared/motion/hexplane.h"

#define NODE_NEIGHBOURS 4
#define NODE_GROUP 16  // consecutive nodes with a common box
#define NODE_SUMS 11   // per node: quaternion, shift, place, log radius

// Boxes for `length` nodes, a multiple of NODE_GROUP: one per group, in whole lanes.
static inline uint node_boxes(uint length) { return (length / NODE_GROUP + 15) / 16 * 16; }

// The pose for outputs o of the network. turn: the quaternion before it is normalised.
static inline real4 node_turn(const real* o) {
  return make_real4((real)1 + o[3], o[4], o[5], o[6]);
}
static inline BasisPose node_pose(real3 place, HexplaneGrid grid, const real* o) {
  BasisPose p;
  p.quat = quat_normalize(node_turn(o)).q;
  p.shift = make_real3((real)grid.half_size[0] * o[0], (real)grid.half_size[1] * o[1],
                       (real)grid.half_size[2] * o[2]);
  p.pivot = place;
  return p;
}
// The gradient by o[0..6], given those by the unit quaternion and the shift.
static inline void node_pose_vjp(HexplaneGrid grid, const real* o, real4 v_unit, real3 v_shift,
                                 real* v_o) {
  const real4 v_quat = quat_normalize_vjp(quat_normalize(node_turn(o)), v_unit);
  v_o[0] = (real)grid.half_size[0] * v_shift.x;
  v_o[1] = (real)grid.half_size[1] * v_shift.y;
  v_o[2] = (real)grid.half_size[2] * v_shift.z;
  v_o[3] = v_quat.x;
  v_o[4] = v_quat.y;
  v_o[5] = v_quat.z;
  v_o[6] = v_quat.w;
}

// Rigidity between node a and its neighbour b (embedded deformation): how far b is from where a
// would carry it, R(q_a) (p_b - p_a) + p_a + s_a - (p_b + s_b).
static inline real3 node_strain(BasisPose a, BasisPose b) {
  return basis_shift(a, b.pivot) - b.shift;
}
// The weight of a link, which makes the strain relative to its length.
static inline real node_link_weight(BasisPose a, BasisPose b) {
  const real3 arm = b.pivot - a.pivot;
  return (real)1 / fmax(dot(arm, arm), (real)1e-12f);
}

#endif
