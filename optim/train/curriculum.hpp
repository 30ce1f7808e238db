// SPDX-License-Identifier: Apache-2.0
// In which order a model with one common pose learns the video: first the pose, from the views at
// the moment that is seen best, then views further and further away in time. A pose that moves far
// is followed from where it is known, not searched for at all times at once.
#pragma once
#include "optim/options/train_options.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// Training steps. As it is made: all at once, which is what other models do.
struct Curriculum {
  int warmup = 0;      // steps before anything learns to move
  double steps = 0;    // that it takes from there
  int iterations = 1;  // of the whole training

  // As `config` has it for motion models that are permanent, all at once for others.
  static Curriculum of(const TrainOptions& config, bool permanent);

  bool warming(int step) const { return step < warmup; }
  // How much of it is done, 0 to 1.
  double share(int step) const;
  // How much of the training after it is done, 0 to 1: rates of the motion stay up until then.
  double share_after(int step) const;
  // Which of n views, sorted from moment_to_begin() outwards, a step looks at. Meanwhile odd
  // turns go round all views so far, even ones round the outermost of them.
  size_t view_at(size_t n, int step, uint32_t seed, size_t turn) const;
};

// The time [0, 1] of the step that has most pictures, of several the one nearest to the middle of
// the video, which it is where all have as many. 0 where other views of the first moment are given.
double moment_to_begin(const std::vector<Frame>& frames);

// Order of training views: index i of the endless sequence in which each of n items comes once a
// round, in a new order every round. Deterministic in (seed, i).
size_t shuffled(size_t n, uint32_t seed, size_t i);

}  // namespace gflow
