// SPDX-License-Identifier: Apache-2.0
// Learning rates and epsilons of Adam by kind of parameter (settings lr.* and adam.*).
#pragma once
#include "optim/motion/models.hpp"
#include "optim/options/train_options.hpp"
#include "optim/scene/scene.hpp"
#include "runtime/primitives/adam.hpp"

namespace gflow {

class Rates {
 public:
  // The references must outlive it.
  Rates(const TrainOptions& config, const Scene& scene, const MotionShape& shape);

  // Learning rate of positions, without `scale` and per-Gaussian factors [scene units].
  float position(int step) const;
  AdamRate of(const GroupSpec& spec, int step) const;
  // Largest factor of lr.pace, >= 1: that of the settings, but no larger than moves a Gaussian by
  // kMostPixels in a step. Flow could not correct longer ones.
  float pace_most() const { return pace_most_; }

  // Learning-rate scale, a factor on all rates; saved in checkpoints.
  float scale = 1;

 private:
  AdamRate planned(Quantity quantity, int step) const;

  const TrainOptions& config_;
  const LearningRateOptions lr_;  // of this model and number of steps
  const Scene& scene_;
  const MotionShape& shape_;
  float pace_most_;
};

}  // namespace gflow
