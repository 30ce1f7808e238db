// SPDX-License-Identifier: Apache-2.0
// The motion loss between neighbours at two times (formulas: shared/motion/motion_loss.h), among the
// Gaussians visible in a view. A work-item sums the gradient of one Gaussian over its pairs, in
// order: no two work-items add to the same element, so the result is bitwise repeatable. A pair is
// in the lists of both Gaussians and computed twice: cheaper than storing its gradient.
#include "shared/arrays.h"
#include "shared/motion/motion_loss.h"

// Rotations from t2 back to t1 of the visible Gaussians.
kernel void motion_rotations(const uint n, global const uint* restrict seen,
                         global const float* restrict factors1,  // [N, 3, 3]
                         global const float* restrict factors2,  // [N, 3, 3]
                         global float* restrict turns) {         // [N, 3, 3]
  const uint i = get_global_id(0);
  if (i >= n || seen[i] == 0) return;
  store_mat3(turns, i, relative_rotation(load_mat3(factors1, i), load_mat3(factors2, i)).t);
}

// Without rigidity and rotation, turns and factors are not read nor v_factors written.
static inline PairMember load_mover(uint i, int turning, global const float* means1,
                               global const float* means2, global const float* turns) {
  PairMember m;
  m.mean1 = load3(means1, i);
  m.mean2 = load3(means2, i);
  m.turn = turning ? load_mat3(turns, i) : mat3_identity();
  return m;
}

static inline void add_mat3(global float* p, uint i, Mat3 v) {
  store_mat3(p, i, mat3_add(load_mat3(p, i), v));
}

kernel void motion_pairs(const uint n, const MotionLossRule rule, global const uint* restrict seen,
                         global const uint* restrict offsets,     // [N + 1] a Gaussian's first pair
                         global const uint* restrict others,      // [pairs] the other Gaussian
                         global const float* restrict distances,  // [pairs] reference distance
                         global const float* restrict weights,    // [pairs]
                         global const float* restrict means1, global const float* restrict means2,
                         global const float* restrict factors1,
                         global const float* restrict factors2, global const float* restrict turns,
                         global float* restrict v_means1,    // [N, 3] added to, as the next three
                         global float* restrict v_factors1,  // [N, 3, 3]
                         global float* restrict v_means2, global float* restrict v_factors2,
                         global float* restrict terms) {  // [4, N] rigidity, rotation, ...
  const uint i = get_global_id(0);
  if (i >= n) return;
  const int turning = rule.rigidity > 0.f || rule.rotation > 0.f;
  PairTerms sum;
  sum.rigidity = sum.rotation = sum.isometry = sum.velocity = 0.f;
  if (seen[i] != 0) {
    const PairMember own = load_mover(i, turning, means1, means2, turns);
    PairMember v;
    v.mean1 = v.mean2 = make_real3(0.f, 0.f, 0.f);
    v.turn = mat3_scale(mat3_identity(), 0.f);
    for (uint k = offsets[i]; k < offsets[i + 1]; ++k) {
      const uint j = others[k];
      if (seen[j] == 0) continue;
      const PairShare share = pair_share(rule, weights[k], distances[k], own,
                                         load_mover(j, turning, means1, means2, turns));
      sum.rigidity += share.terms.rigidity;
      sum.rotation += share.terms.rotation;
      sum.isometry += share.terms.isometry;
      sum.velocity += share.terms.velocity;
      v.mean1 += share.gradient.mean1;
      v.mean2 += share.gradient.mean2;
      v.turn = mat3_add(v.turn, share.gradient.turn);
    }
    add3(v_means1, i, v.mean1);
    add3(v_means2, i, v.mean2);
    if (turning) {
      const TurnGradient g =
          turn_vjp(relative_rotation(load_mat3(factors1, i), load_mat3(factors2, i)), v.turn);
      add_mat3(v_factors1, i, g.factor1);
      add_mat3(v_factors2, i, g.factor2);
    }
  }
  terms[i] = sum.rigidity;
  terms[n + i] = sum.rotation;
  terms[2 * n + i] = sum.isometry;
  terms[3 * n + i] = sum.velocity;
}

kernel void motion_acceleration(const uint n, const MotionLossRule rule, global const uint* restrict seen,
                         global const float* restrict means0, global const float* restrict means1,
                         global const float* restrict means2,
                         global float* restrict v_means0,  // [N, 3] added to, as the next two
                         global float* restrict v_means1,  // [N, 3]
                         global float* restrict v_means2,  // [N, 3]
                         global float* restrict terms) {   // [N]
  const uint i = get_global_id(0);
  if (i >= n) return;
  terms[i] = 0.f;
  if (seen[i] == 0) return;
  const Bend bend = acceleration_loss(rule, load3(means0, i), load3(means1, i), load3(means2, i));
  terms[i] = bend.value;
  add3(v_means0, i, bend.gradient);
  add3(v_means1, i, bend.gradient * -2.f);
  add3(v_means2, i, bend.gradient);
}
