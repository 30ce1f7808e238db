// SPDX-License-Identifier: Apache-2.0
// The nodes motion model on the device (formulas: shared/motion/nodes.h): the poses of the nodes at
// a time, Gaussians that follow their nearest nodes, and the gradients. Windows, first and second
// time are as in native4d.cl. Gradients of the nodes are summed over chunks of Gaussians, then over
// chunks in order: bitwise repeatable.
#include "motion/plane_field.cl"
#include "shared/arrays.h"
#include "shared/motion/canonical_rows.h"
#include "shared/motion/nodes.h"

#define POSE 7           // floats per pose: unit quaternion, shift
#define BLEND 8          // floats per blend: shift, 0, turn
#define TOLD_MOST 1e18f  // its square is finite
#define FAR 1e20f        // its square is infinite

typedef union LaneFloats {
  lane all;
  float row[LANES];
} LaneFloats;

// What Gaussians look up of the nodes: [4, length] x, y, z and 1 / radius^2, then the boxes around
// each NODE_GROUP of them, [6, node_boxes(length)]: least x y z, greatest x y z. What is beyond the
// last node is far away. One work-item per entry of a column of places.
kernel void nodes_columns(const uint nodes, const uint length, global const float* restrict places,
                          global const float* restrict log_radii, global float* restrict columns) {
  const uint k = get_global_id(0), groups = node_boxes(length);
  if (k >= length) return;
  const real3 p = k < nodes ? load3(places, k) : make_real3(FAR, FAR, FAR);
  columns[k] = p.x;
  columns[length + k] = p.y;
  columns[2 * length + k] = p.z;
  columns[3 * length + k] = k < nodes ? exp(-2.f * log_radii[k]) : 0.f;
  if (k >= groups) return;
  const uint begin = k * NODE_GROUP, end = min(nodes, begin + NODE_GROUP);
  real3 least = make_real3(FAR, FAR, FAR), most = begin < end ? -least : least;
  for (uint j = begin; j < end; ++j) least = fmin(least, load3(places, j));
  for (uint j = begin; j < end; ++j) most = fmax(most, load3(places, j));
  global float* boxes = columns + 4 * length;
  boxes[k] = least.x, boxes[groups + k] = least.y, boxes[2 * groups + k] = least.z;
  boxes[3 * groups + k] = most.x, boxes[4 * groups + k] = most.y, boxes[5 * groups + k] = most.z;
}

// Bit r is set where lane r of a comparison is true; the number of the lowest set bit.
static inline uint lanes_where(lane_int mask) {
#if LANES == 1
  return mask != 0;
#else
  return (uint)lane_any(mask & ((lane_int)(1) << ROW_COLUMN));
#endif
}
static inline uint lowest(uint bits) { return 31 - clz(bits & -bits); }

typedef struct Nearest {  // nearest first; the first ones of equally near ones
  float squared[NODE_NEIGHBOURS];
  uint node[NODE_NEIGHBOURS];
} Nearest;

// Adds the nodes of a group, without node `self`.
static inline void meet_group(real3 m, uint self, uint group, uint length,
                              global const float* columns, Nearest* near) {
  const int last = NODE_NEIGHBOURS - 1;
  for (uint first = group * NODE_GROUP; first < (group + 1) * NODE_GROUP; first += LANES) {
    const lane x = ROW_LOAD(columns + first) - m.x;
    const lane y = ROW_LOAD(columns + length + first) - m.y;
    const lane z = ROW_LOAD(columns + 2 * length + first) - m.z;
    LaneFloats squared;
    squared.all = fma(x, x, fma(y, y, z * z));
    for (uint left = lanes_where(squared.all <= TO_LANE(near->squared[last])); left;
         left &= left - 1) {
      const uint r = lowest(left);
      float d = squared.row[r];
      uint k = first + r;
      if (k == self) continue;
#pragma unroll
      for (int j = 0; j < NODE_NEIGHBOURS; ++j) {  // in order of distance, then of number
        const float other = near->squared[j];
        const uint its = near->node[j];
        const int before = d < other || (d == other && k < its);
        near->squared[j] = before ? d : other;
        near->node[j] = before ? k : its;
        d = before ? other : d;
        k = before ? its : k;
      }
    }
  }
}

// Squared distances from a place to LANES boxes, at most those to the nodes in them.
static inline lane box_distances(real3 m, uint group, uint length, global const float* columns) {
  const uint groups = node_boxes(length);
  global const float* box = columns + 4 * length + group;
  const lane none = TO_LANE(0.f);
  const lane x = fmax(none, fmax(ROW_LOAD(box) - m.x, m.x - ROW_LOAD(box + 3 * groups)));
  const lane y = fmax(none, fmax(ROW_LOAD(box + groups) - m.y, m.y - ROW_LOAD(box + 4 * groups)));
  const lane z =
      fmax(none, fmax(ROW_LOAD(box + 2 * groups) - m.z, m.z - ROW_LOAD(box + 5 * groups)));
  return fma(x, x, fma(y, y, z * z));
}

// The squared distance of the farthest of these nodes, if they are NODE_NEIGHBOURS different ones
// below `nodes`; else infinity.
static inline float reach(real3 m, uint nodes, uint length, global const float* columns,
                          global const uint* near) {
  float most = 0.f;
  for (int k = 0; k < NODE_NEIGHBOURS; ++k) {
    const uint node = near[k];
    if (node >= nodes) return INFINITY;
    for (int j = 0; j < k; ++j)
      if (near[j] == node) return INFINITY;
    const float x = columns[node] - m.x, y = columns[length + node] - m.y,
                z = columns[2 * length + node] - m.z;
    most = fmax(most, fma(x, x, fma(y, y, z * z)));
  }
  return most;
}

// The nearest nodes of a place, without node `self`. `most`: a squared distance within which
// NODE_NEIGHBOURS of them are, which saves looking farther; infinity if not known.
static inline Nearest nearest_nodes(real3 m, uint self, float most, uint length,
                                    global const float* columns) {
  Nearest near;
  const uint none = most < INFINITY ? UINT_MAX : 0;  // found nodes come before it
  for (int k = 0; k < NODE_NEIGHBOURS; ++k) near.squared[k] = most, near.node[k] = none;
  const uint groups = node_boxes(length);
  for (uint g = 0; g < groups; g += LANES) {
    LaneFloats away;
    away.all = box_distances(m, g, length, columns);
    for (uint left = lanes_where(away.all <= TO_LANE(near.squared[NODE_NEIGHBOURS - 1])); left;
         left &= left - 1) {
      const uint r = lowest(left);
      if (away.row[r] <= near.squared[NODE_NEIGHBOURS - 1] && away.row[r] < INFINITY)
        meet_group(m, self, g + r, length, columns, &near);
    }
  }
  for (int k = 0; k < NODE_NEIGHBOURS; ++k)
    if (near.node[k] == UINT_MAX) near.node[k] = 0;  // the place is not a number
  return near;
}

// The nearest other nodes of each node. One work-item per node.
kernel void nodes_links(const uint nodes, const uint length, global const float* restrict places,
                        global const float* restrict columns,
                        global uint* restrict links) {  // [nodes, NODE_NEIGHBOURS]
  const uint k = get_global_id(0);
  if (k >= nodes) return;
  const Nearest near = nearest_nodes(load3(places, k), k, INFINITY, length, columns);
  for (int j = 0; j < NODE_NEIGHBOURS; ++j) links[NODE_NEIGHBOURS * k + j] = near.node[j];
}

// Evaluates the field at the nodes first .. first + BLOCK - 1; those beyond the last repeat it.
static inline void block_fwd(uint first, uint nodes, HexplaneGrid grid, global const float* places,
                             global const float* planes, global const float* lines,
                             global const float* network, Activations* a) {
  uint rows[BLOCK];
  for (int b = 0; b < BLOCK; ++b) rows[b] = min(first + b, nodes - 1);
  field_fwd(rows, BLOCK, grid, places, planes, lines, network, a);
}

// The poses of the nodes at a time, and their rows. One work-item per BLOCK nodes.
kernel void nodes_pose(const uint nodes, const HexplaneGrid grid,
                       global const float* restrict places, global const float* restrict planes,
                       global const float* restrict lines, global const float* restrict network,
                       global float* restrict outputs,      // [nodes, OUTPUTS] of the network
                       global float* restrict poses,        // [nodes, POSE]
                       global float* restrict node_rows) {  // [nodes, NODE_ROW]
  const uint first = get_global_id(0) * BLOCK;
  if (first >= nodes) return;
  Activations a;
  block_fwd(first, nodes, grid, places, planes, lines, network, &a);
  for (int b = 0; b < BLOCK && first + b < nodes; ++b) {
    const float* o = a.outputs + b * OUTPUTS;
    const BasisPose p = node_pose(load3(places, first + b), grid, o);
    for (int k = 0; k < OUTPUTS; ++k) outputs[(size_t)(first + b) * OUTPUTS + k] = o[k];
    vstore4(p.quat, 0, poses + POSE * (first + b));
    store3(poses + POSE * (first + b) + 4, 0, p.shift);
    float row[NODE_ROW];
    node_row(p, node_centre(grid), row);
    for (int k = 0; k < NODE_ROW; ++k) node_rows[NODE_ROW * (first + b) + k] = row[k];
  }
}

static inline BasisPose load_pose(uint k, global const float* poses, global const float* places) {
  BasisPose p;
  p.quat = vload4(0, poses + POSE * k);
  p.shift = load3(poses + POSE * k + 4, 0);
  p.pivot = load3(places, k);
  return p;
}

// The nearest nodes of the Gaussians of a view, and their weights. Those of the last step tell how
// far to look, so `near` may hold anything before. A kernel of its own, as nodes_blend is: OpenCL
// on a CPU makes SIMD of the Gaussians in nodes_fwd only where it has no such loops, while here
// lanes are nodes or numbers of a row.
kernel void nodes_near(const uint n, const uint nodes, const int first,
                       global const uint* restrict rows,
                       global const uint* restrict tiles_touched,  // [n] read if not first
                       global const float* restrict means, const uint length,
                       global const float* restrict columns,
                       global uint* restrict near,        // [n, NODE_NEIGHBOURS]
                       global float* restrict weights) {  // [n, NODE_NEIGHBOURS]
  const uint k = get_global_id(0);
  if (k >= n || (!first && tiles_touched[k] == 0)) return;
  const real3 m = load3(means, view_row(k, rows));
  global uint* own = near + NODE_NEIGHBOURS * k;
  const Nearest found =
      nearest_nodes(m, UINT_MAX, reach(m, nodes, length, columns, own), length, columns);
  float exponents[NODE_NEIGHBOURS];
  for (int j = 0; j < NODE_NEIGHBOURS; ++j) {
    own[j] = found.node[j];
    exponents[j] = 0.5f * found.squared[j] * columns[3 * length + found.node[j]];
  }
  const float4 e = vload4(0, exponents);  // one exp() of four is much faster than four
  const float4 w = exp(fmin(fmin(e.x, e.y), fmin(e.z, e.w)) - e);
  vstore4(w / (w.x + w.y + w.z + w.w), k, weights);
}

#define ROW_PARTS (NODE_ROW / LANES)  // vectors per row

// The weighted sum of the rows of the nearest nodes, as shift and turn.
kernel void nodes_blend(const uint n, const int first, const HexplaneGrid grid,
                        global const uint* restrict rows,
                        global const uint* restrict tiles_touched,  // [n] read if not first
                        global const float* restrict means, global const float* restrict node_rows,
                        global const uint* restrict near, global const float* restrict weights,
                        global float* restrict blends) {  // [n, BLEND]
  const uint k = get_global_id(0);
  if (k >= n || (!first && tiles_touched[k] == 0)) return;
  float row[NODE_ROW];
  for (int part = 0; part < ROW_PARTS; ++part) {
    lane sum = TO_LANE(0.f);
    for (int j = 0; j < NODE_NEIGHBOURS; ++j) {
      const uint at = NODE_NEIGHBOURS * k + j;
      sum =
          fma(TO_LANE(weights[at]), ROW_LOAD(node_rows + NODE_ROW * near[at] + part * LANES), sum);
    }
    ROW_STORE(sum, row + part * LANES);
  }
  const NodeBlend b = node_blend(row, load3(means, view_row(k, rows)) - node_centre(grid));
  vstore4((float4)(b.shift.x, b.shift.y, b.shift.z, 0.f), 2 * k, blends);
  vstore4(b.turn, 2 * k + 1, blends);
}

static inline Canonical follow(Canonical g, uint k, global const float* blends) {
  return blended(g, load3(blends + BLEND * k, 0), vload4(2 * k + 1, blends));
}

// Rows from `moving` on are static: they have no blends and keep their canonical pose.
kernel void nodes_fwd(const uint n, const uint moving, const float t, const float sigmas,
                      const int first, global const uint* restrict rows,
                      global const uint* restrict tiles_touched,  // [n] read if not first
                      CANONICAL_IN,
                      global const float* restrict blends,    // [n, BLEND]
                      global float* restrict means_at,        // [n, 3]
                      global float* restrict factors_at,      // [n, 3, 3]
                      global float* restrict opacities_at) {  // [n]
  const uint k = get_global_id(0);
  if (k >= n) return;
  const uint i = view_row(k, rows);
  if (!canonical_in_window(i, k, t, sigmas, first, tiles_touched, means_t, log_scales,
                           opacities_at))
    return;
  Canonical g = load_canonical(i, CANONICAL_ROWS);
  if (i < moving) g = follow(g, k, blends);
  store_shifted(k, shifted_at(g, no_shift(), t), means_at, factors_at, opacities_at);
}

// To the canonical Gaussians as if nodes stood still, and to the blends.
kernel void nodes_bwd(const uint n, const uint moving, const float t, const int first,
                      global const uint* restrict rows, CANONICAL_IN,
                      global const float* restrict blends,
                      global const uint* restrict tiles_touched,    // [n]
                      global const float* restrict v_means_at,      // [n, 3]
                      global const float* restrict v_factors_at,    // [n, 3, 3]
                      global const float* restrict v_opacities_at,  // [n] read if first
                      global uint* restrict seen, V_CANONICAL_OUT,
                      global float* restrict v_blends) {  // [n, BLEND]
  const uint k = get_global_id(0);
  if (k >= n || tiles_touched[k] == 0) return;
  const uint i = view_row(k, rows);
  const Canonical canonical = load_canonical(i, CANONICAL_ROWS);
  const int moves = i < moving;
  Canonical v = shifted_vjp(moves ? follow(canonical, k, blends) : canonical, no_shift(), t,
                            load3(v_means_at, k), load_mat3(v_factors_at, k),
                            first ? v_opacities_at[k] : 0.f);
  if (moves) {  // the followed quaternion is (1 + turn) canonical.quat
    vstore4((float4)(v.mean.x, v.mean.y, v.mean.z, 0.f), 2 * k, v_blends);
    vstore4(quat_mul(v.quat, quat_conj(canonical.quat)), 2 * k + 1, v_blends);
    const real4 one = make_real4(1.f, 0.f, 0.f, 0.f);
    v.quat = quat_mul(quat_conj(vload4(2 * k + 1, blends) + one), v.quat);
  }
  const int fresh = first && !seen[i];
  if (fresh) seen[i] = 1;
  put_canonical(i, v, fresh, V_CANONICAL_ROWS);
}

// From the blends to the nodes' rows, places and radii, and what Gaussians' means owe to their
// blends. One work-item per chunk of `chunk_length` entries of the view.
kernel void nodes_sum(const uint n, const uint chunk_length, const uint nodes,
                      const HexplaneGrid grid, global const uint* restrict rows,
                      global const float* restrict means, const uint length,
                      global const float* restrict columns, global const float* restrict node_rows,
                      global const uint* restrict near, global const float* restrict weights,
                      global const uint* restrict tiles_touched,  // [n]
                      global const float* restrict v_blends, global float* restrict v_means,
                      global float* restrict sums) {  // [chunks, nodes, NODE_SUMS]
  const uint chunk = get_global_id(0), begin = chunk * chunk_length;
  const uint end = min(n, begin + chunk_length);
  global float* own = sums + (size_t)chunk * nodes * NODE_SUMS;
  for (uint k = 0; k < nodes * NODE_SUMS; ++k) own[k] = 0.f;
  for (uint entry = begin; entry < end; ++entry) {
    if (tiles_touched[entry] == 0) continue;
    const uint i = view_row(entry, rows);
    const real3 m = load3(means, i);
    const NodeBlend v = {load3(v_blends + BLEND * entry, 0), vload4(2 * entry + 1, v_blends)};
    float v_row[NODE_ROW], row[NODE_ROW];
    node_blend_vjp(m - node_centre(grid), v, v_row);
    uint node[NODE_NEIGHBOURS];
    float share[NODE_NEIGHBOURS], v_share[NODE_NEIGHBOURS], middle = 0.f;  // their weighted mean
    for (int k = 0; k < NODE_NEIGHBOURS; ++k) {
      node[k] = near[NODE_NEIGHBOURS * entry + k];
      share[k] = weights[NODE_NEIGHBOURS * entry + k];
    }
    lane product[NODE_NEIGHBOURS];
    for (int k = 0; k < NODE_NEIGHBOURS; ++k) product[k] = TO_LANE(0.f);
    float size = 0.f;
    for (int part = 0; part < ROW_PARTS; ++part) {
      const lane v_part = ROW_LOAD(v_row + part * LANES);
      lane sum = TO_LANE(0.f);
      for (int k = 0; k < NODE_NEIGHBOURS; ++k) {
        const lane x = ROW_LOAD(node_rows + NODE_ROW * node[k] + part * LANES);
        product[k] = fma(v_part, x, product[k]);
        sum = fma(TO_LANE(share[k]), x, sum);
      }
      ROW_STORE(sum, row + part * LANES);
      size += ROW_SUM(fabs(v_part));
    }
    for (int k = 0; k < NODE_NEIGHBOURS; ++k) {
      v_share[k] = ROW_SUM(product[k]);
      middle += share[k] * v_share[k];
    }
    real3 v_mean = node_blend_vjp_place(row, v.shift);
    for (int k = 0; k < NODE_NEIGHBOURS; ++k) {
      const real3 arm = make_real3(m.x - columns[node[k]], m.y - columns[length + node[k]],
                                   m.z - columns[2 * length + node[k]]);
      const float v_exponent = share[k] * (middle - v_share[k]);
      const float sharpness = columns[3 * length + node[k]];
      const real3 pulled = arm * (v_exponent * sharpness);
      v_mean += pulled;
      // A broken Gaussian keeps its gradient, but must not affect the shared nodes, nor may what it
      // tells them overflow on the way through the network.
      const float v_log_radius = -dot(arm, pulled);
      const float told =
          size + fabs(pulled.x) + fabs(pulled.y) + fabs(pulled.z) + fabs(v_log_radius);
      if (!(told < TOLD_MOST)) continue;
      global float* o = own + NODE_SUMS * node[k];
      for (int part = 0; part < ROW_PARTS; ++part)
        ROW_STORE(
            fma(TO_LANE(share[k]), ROW_LOAD(v_row + part * LANES), ROW_LOAD(o + part * LANES)),
            o + part * LANES);
      o += NODE_ROW;
      vstore4(vload4(0, o) - (float4)(pulled.x, pulled.y, pulled.z, -v_log_radius), 0, o);
    }
    add3(v_means, i, v_mean);
  }
}

// Gradient of the rigidity by the pose of node k: as the middle of its links and as the end of
// others'. `weight` per link; places and links are constants.
static inline void add_strain(uint k, uint nodes, float weight, global const float* poses,
                              global const float* places, global const uint* links, real4* v_unit,
                              real3* v_shift) {
  const BasisPose own = load_pose(k, poses, places);
  for (int j = 0; j < NODE_NEIGHBOURS; ++j) {
    const BasisPose other = load_pose(links[NODE_NEIGHBOURS * k + j], poses, places);
    const real3 v = node_strain(own, other) * (2.f * weight * node_link_weight(own, other));
    const BasisPose v_own =
        basis_pose_vjp(own, 1.f, other.pivot, v, make_real4(0.f, 0.f, 0.f, 0.f));
    *v_unit += v_own.quat;
    *v_shift += v_own.shift;
  }
  for (uint e = 0; e < nodes * NODE_NEIGHBOURS; ++e) {
    if (links[e] != k) continue;
    const BasisPose other = load_pose(e / NODE_NEIGHBOURS, poses, places);
    *v_shift -= node_strain(other, own) * (2.f * weight * node_link_weight(other, own));
  }
}

// Sums the chunks of a node and passes the gradient of its pose on to the outputs of the network.
// One work-item per node.
kernel void nodes_gather(const uint chunks, const uint nodes, const HexplaneGrid grid,
                         const float rigidity, global const float* restrict sums,
                         global const float* restrict outputs, global const float* restrict poses,
                         global const float* restrict places, global const uint* restrict links,
                         global uint* restrict seen, global float* restrict v_places,
                         global float* restrict v_log_radii,
                         global float* restrict v_outputs) {  // [nodes, OUTPUTS]
  const uint k = get_global_id(0);
  if (k >= nodes) return;
  float sum[NODE_SUMS];
  for (int j = 0; j < NODE_SUMS; ++j) sum[j] = 0.f;
  for (uint c = 0; c < chunks; ++c)
    for (int j = 0; j < NODE_SUMS; ++j) sum[j] += sums[((size_t)c * nodes + k) * NODE_SUMS + j];
  real4 v_unit;
  real3 v_shift, v_place;
  node_row_vjp(load_pose(k, poses, places), node_centre(grid), sum, &v_unit, &v_shift, &v_place);
  v_place += make_real3(sum[NODE_ROW], sum[NODE_ROW + 1], sum[NODE_ROW + 2]);
  if (rigidity > 0.f)
    add_strain(k, nodes, rigidity / (float)(nodes * NODE_NEIGHBOURS), poses, places, links, &v_unit,
               &v_shift);
  float o[OUTPUTS], v_o[OUTPUTS];
  for (int j = 0; j < OUTPUTS; ++j) o[j] = outputs[(size_t)k * OUTPUTS + j], v_o[j] = 0.f;
  node_pose_vjp(grid, o, v_unit, v_shift, v_o);
  for (int j = 0; j < OUTPUTS; ++j) v_outputs[(size_t)k * OUTPUTS + j] = v_o[j];
  if (seen[k]) {
    add3(v_places, k, v_place);
    v_log_radii[k] += sum[NODE_ROW + 3];
  } else {
    seen[k] = 1;
    store3(v_places, k, v_place);
    v_log_radii[k] = sum[NODE_ROW + 3];
  }
}

// From the outputs of the network to its weights and the features. One work-item per chunk of
// `chunk_length` nodes, a multiple of BLOCK; of a GPU, per node.
kernel void nodes_bwd_network(const uint nodes, const uint chunk_length, const HexplaneGrid grid,
                              global const float* restrict places,
                              global const float* restrict planes,
                              global const float* restrict lines,
                              global const float* restrict network,
                              global const float* restrict transposed,
                              global const float* restrict v_outputs,
                              global float* restrict v_networks,    // [chunks, WEIGHTS]; CPU
                              global float* restrict kept,          // [nodes, KEPT]; GPU
                              global uint* restrict used,           // [nodes] set to 1
                              global float* restrict v_features) {  // [nodes, FEATURES]
  const uint chunk = get_global_id(0), begin = chunk * chunk_length;
  const uint end = min(nodes, begin + chunk_length);
  global float* v_network = v_networks + (size_t)chunk * WEIGHTS;
#if LANES > 1
  for (uint w = 0; w < WEIGHTS; w += LANES) ROW_STORE(TO_LANE(0.f), v_network + w);
#endif
  Activations a;
  float v_out[BLOCK * OUTPUTS], v_x[BLOCK * FEATURES];
  for (uint row = begin; row < end; row += BLOCK) {
    block_fwd(row, nodes, grid, places, planes, lines, network, &a);
    for (int b = 0; b < BLOCK; ++b)
      for (int k = 0; k < OUTPUTS; ++k)
        v_out[b * OUTPUTS + k] = row + b < end ? v_outputs[(size_t)(row + b) * OUTPUTS + k] : 0.f;
    network_bwd(&a, v_out, transposed, v_network, kept + (size_t)row * KEPT, v_x);
    for (int b = 0; b < BLOCK && row + b < end; ++b) {
      used[row + b] = 1;
      for (int k = 0; k < FEATURES; k += LANES)
        ROW_STORE(ROW_LOAD(v_x + b * FEATURES + k), v_features + (size_t)(row + b) * FEATURES + k);
    }
  }
}
