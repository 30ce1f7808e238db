// SPDX-License-Identifier: Apache-2.0
// Sequential training, as in Dynamic 3D Gaussians: the first time step fits the scene, each next
// one only moves it, starting with its previous velocity.
#pragma once
#include "optim/options/train_options.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// What a training step trains. Without train.sequential one stage, with all times, is the whole
// training.
struct Stage {
  int time_step = -1;                            // the only time step trained; -1: all
  bool begins = false;                           // the first training step of the stage
  double share = 0;                              // progress of the stage, in [0, 1)
  bool fits() const { return time_step <= 0; }   // the Gaussians themselves are trained
  bool moves() const { return time_step != 0; }  // their motion is trained
};

// Error if train.sequential is set and not possible: it needs a keyframes model with one key per
// time step, and a training image of each time step.
void require_sequence(const TrainOptions& config, const Scene& scene, const MotionShape& shape);

// The stage of a training step. time_steps: of the scene, >= 1.
Stage stage_at(const ScheduleOptions& config, int time_steps, int step);

}  // namespace gflow
