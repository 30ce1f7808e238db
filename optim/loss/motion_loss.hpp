// SPDX-License-Identifier: Apache-2.0
// Regularisers of motion: neighbours keep together, turn alike, keep their distance, move alike;
// paths bend little. Formulas: kernels/shared/motion_loss.h. They act on the Gaussians that a
// motion model gives at two (three) moments, so every model has them, and among those seen in a
// view, hidden ones included: whatever else a training step changes.
#pragma once
#include "optim/engine/gaussians.hpp"
#include "optim/loss/loss_options.hpp"
#include "optim/loss/neighbours.hpp"
#include "runtime/primitives/reduce.hpp"
#include "shared/motion_loss.h"

GFLOW_KERNEL_STRUCT(MotionLossRule);

namespace gflow {

// Lengths count in scene extents. Each term is a mean over all pairs (acceleration: over all
// Gaussians) of the model, what is not seen counting as 0: so a pair pulls as hard in the view of a
// part.
struct MotionLossWeights : LossOptions {
  float extent = 1;  // of the scene [scene units]

  bool any_turns() const { return rigidity > 0 || rotation > 0; }
  bool any_pairs() const { return any_turns() || isometry > 0 || velocity > 0; }
};

// The terms of one view, times their weights.
struct MotionLossValue {
  double rigidity = 0, rotation = 0, isometry = 0, velocity = 0, acceleration = 0;
  double total() const { return rigidity + rotation + isometry + velocity + acceleration; }
};

class MotionLoss {
 public:
  MotionLoss(Queue& queue, const MotionLossWeights& weights);

  const MotionLossWeights& weights() const { return weights_; }
  // Who are neighbours, until the next call.
  void set_pairs(Queue& queue, NeighbourPairs pairs);
  const NeighbourPairs& pairs() const { return pairs_; }

  // Adds the gradients, at t1 and t2, of all terms for the Gaussians with seen[i] > 0, the others
  // being left alone. at_t0: at 2 t1 - t2, then v_means_t0 is set for them; or nullptr: no
  // acceleration in this view. Error when the pairs are not of as many Gaussians.
  void run(Queue& queue, const Buffer<cl_uint>& seen, const GaussiansAt* at_t0,
           const GaussiansAt& at_t1, const GaussiansAt& at_t2, GaussianGradients& v);

  // Of the last run(); waits.
  MotionLossValue value(Queue& queue);

 private:
  MotionLossWeights weights_;
  Program program_;
  Kernel<cl_uint, In<cl_uint>, In<float>, In<float>, Out<float>> motion_turns_;
  Kernel<cl_uint, MotionLossRule, In<cl_uint>, In<cl_uint>, In<cl_uint>, In<float>, In<float>,
         In<float>, In<float>, In<float>, In<float>, In<float>, Out<float>, Out<float>, Out<float>,
         Out<float>, Out<float>>
      motion_pairs_;
  Kernel<cl_uint, MotionLossRule, In<cl_uint>, In<float>, In<float>, In<float>, Out<float>,
         Out<float>, Out<float>, Out<float>>
      motion_bends_;
  Reduce reduce_;
  NeighbourPairs pairs_;
  Buffer<cl_uint> offsets_{"neighbour offsets"}, others_{"neighbours"};
  Buffer<float> distances_{"neighbour distances"}, pair_weights_{"neighbour weights"};
  Buffer<float> turns_{"turns between two moments"};
  Buffer<float> pair_terms_{"pair terms"}, bend_terms_{"acceleration terms"};  // [4, N], [N]
  bool ran_pairs_ = false, ran_bends_ = false;
};

}  // namespace gflow
