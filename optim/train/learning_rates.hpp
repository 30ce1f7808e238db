// SPDX-License-Identifier: Apache-2.0
// How far Adam may go in a step with each kind of parameter (settings lr.* and adam.*).
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

  // Of positions, before scale and what is the model's own [scene units].
  float position(int step) const;
  AdamRate of(const GroupSpec& spec, int step) const;

  // What all of them are multiplied by; part of the state of a training.
  float scale = 1;

 private:
  AdamRate planned(Quantity quantity, int step) const;

  const TrainOptions& config_;
  const Scene& scene_;
  const MotionShape& shape_;
};

}  // namespace gflow
