// SPDX-License-Identifier: Apache-2.0
// Regularisers of motion: neighbours stay rigid, rotate alike, keep their distance and move alike;
// paths bend little. Formulas: kernels/shared/motion/motion_loss.h. They use only the poses that a
// motion model gives at two or three times, so they work for every model. They act on the Gaussians
// that a view touches, occluded ones included: those that the step changes anyway.
#pragma once
#include "optim/engine/gaussians.hpp"
#include "optim/loss/loss_options.hpp"
#include "optim/loss/neighbours.hpp"
#include "runtime/primitives/reduce.hpp"
#include "shared/motion/motion_loss.h"

GFLOW_KERNEL_STRUCT(MotionLossRule);

namespace gflow {

// Lengths are multiples of the scene extent. Each term is a mean over all pairs of the model
// (acceleration: over all Gaussians), in which unseen ones count as 0. So the gradient of a pair
// does not depend on how much of the model a view shows.
struct MotionLossWeights : LossOptions {
  float extent = 1;  // of the scene [scene units]

  bool any_turns() const { return rigidity > 0 || rotation > 0; }
  bool any_pairs() const { return any_turns() || isometry > 0 || velocity > 0; }
};

// The terms of one view, weighted.
struct MotionLossValue {
  double rigidity = 0, rotation = 0, isometry = 0, velocity = 0, acceleration = 0;
  double total() const { return rigidity + rotation + isometry + velocity + acceleration; }
};

class MotionLoss {
 public:
  MotionLoss(Queue& queue, const MotionLossWeights& weights);

  const MotionLossWeights& weights() const { return weights_; }
  // Sets the neighbours until the next call.
  void set_pairs(Queue& queue, NeighbourPairs pairs);
  const NeighbourPairs& pairs() const { return pairs_; }

  // Adds the gradients of all terms at t1 and t2 for the Gaussians with seen[i] > 0. at_t0: poses
  // at 2 t1 - t2, then to v_means_t0, too; nullptr: no acceleration term in this view. Error if the
  // pairs belong to another number of Gaussians.
  void run(Queue& queue, const Buffer<cl_uint>& seen, const GaussiansAt* at_t0,
           const GaussiansAt& at_t1, const GaussiansAt& at_t2, GaussianGradients& v);

  // The terms of the last run(). Waits.
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
