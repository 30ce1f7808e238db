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
#define NODE_ROW 16    // floats of a node's row
#define NODE_SUMS 20   // of a node's gradients: its row, place, log radius

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

// Relative to the centre c of the box, node k moves a place m' = m - c to R_k m' + T_k with
// T_k = R_k (c - p_k) + p_k + s_k - c. So a Gaussian follows the weighted sum of rows of 16
// numbers, (R - 1) by rows, T and q - 1: whole vectors of a CPU.
static inline real3 node_centre(HexplaneGrid grid) {
  return make_real3((real)grid.centre[0], (real)grid.centre[1], (real)grid.centre[2]);
}
static inline void node_row(BasisPose p, real3 centre, real* row) {
  const Mat3 r = quat_to_rotmat(p.quat);
  const real3 t = basis_shift(p, centre);
  const real4 turn = basis_turn(p);
  row[0] = r.r1.x - (real)1, row[1] = r.r1.y, row[2] = r.r1.z;
  row[3] = r.r2.x, row[4] = r.r2.y - (real)1, row[5] = r.r2.z;
  row[6] = r.r3.x, row[7] = r.r3.y, row[8] = r.r3.z - (real)1;
  row[9] = t.x, row[10] = t.y, row[11] = t.z;
  row[12] = turn.x, row[13] = turn.y, row[14] = turn.z, row[15] = turn.w;
}
// The gradients by a node's pose, given that by its row.
static inline void node_row_vjp(BasisPose p, real3 centre, const real* v_row, real4* v_unit,
                                real3* v_shift, real3* v_place) {
  const real3 v_t = make_real3(v_row[9], v_row[10], v_row[11]), arm = centre - p.pivot;
  Mat3 v_r;
  v_r.r1 = make_real3(v_row[0], v_row[1], v_row[2]) + arm * v_t.x;
  v_r.r2 = make_real3(v_row[3], v_row[4], v_row[5]) + arm * v_t.y;
  v_r.r3 = make_real3(v_row[6], v_row[7], v_row[8]) + arm * v_t.z;
  *v_unit =
      quat_to_rotmat_vjp(p.quat, v_r) + make_real4(v_row[12], v_row[13], v_row[14], v_row[15]);
  *v_shift = v_t;
  *v_place = v_t - mat3_transposed_times(quat_to_rotmat(p.quat), v_t);
}

// What a weighted sum of rows does to a place relative to the centre, and the gradients by both.
typedef struct NodeBlend {
  real3 shift;
  real4 turn;
} NodeBlend;
static inline NodeBlend node_blend(const real* row, real3 place) {
  NodeBlend b;
  b.shift = make_real3(dot(make_real3(row[0], row[1], row[2]), place) + row[9],
                       dot(make_real3(row[3], row[4], row[5]), place) + row[10],
                       dot(make_real3(row[6], row[7], row[8]), place) + row[11]);
  b.turn = make_real4(row[12], row[13], row[14], row[15]);
  return b;
}
static inline void node_blend_vjp(real3 place, NodeBlend v, real* v_row) {
  v_row[0] = v.shift.x * place.x, v_row[1] = v.shift.x * place.y, v_row[2] = v.shift.x * place.z;
  v_row[3] = v.shift.y * place.x, v_row[4] = v.shift.y * place.y, v_row[5] = v.shift.y * place.z;
  v_row[6] = v.shift.z * place.x, v_row[7] = v.shift.z * place.y, v_row[8] = v.shift.z * place.z;
  v_row[9] = v.shift.x, v_row[10] = v.shift.y, v_row[11] = v.shift.z;
  v_row[12] = v.turn.x, v_row[13] = v.turn.y, v_row[14] = v.turn.z, v_row[15] = v.turn.w;
}
static inline real3 node_blend_vjp_place(const real* row, real3 v_shift) {
  return make_real3(row[0], row[1], row[2]) * v_shift.x +
         make_real3(row[3], row[4], row[5]) * v_shift.y +
         make_real3(row[6], row[7], row[8]) * v_shift.z;
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
