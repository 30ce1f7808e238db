// SPDX-License-Identifier: Apache-2.0
// Training one time step after the other, as Dynamic 3D Gaussians do: the first fits the scene,
// each next one moves it, starting with the velocity it had.
#pragma once
#include "optim/options/train_options.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// What a training step is about. Without train.sequential all times at once, the whole training.
struct Stage {
  int time_step = -1;                            // the only one trained, or -1: all
  bool begins = false;                           // the first training step of the stage
  double share = 0;                              // of the stage that is done, in [0, 1)
  bool fits() const { return time_step <= 0; }   // the Gaussians themselves are trained
  bool moves() const { return time_step != 0; }  // their motion is
};

// Error when train.sequential is asked for and cannot be: it needs a keyframes model with a key a
// time step, and a training picture of each.
void require_sequence(const TrainOptions& config, const Scene& scene, const MotionShape& shape);

// time_steps >= 1: of the scene.
Stage stage_at(const ScheduleOptions& config, int time_steps, int step);

}  // namespace gflow
