// SPDX-License-Identifier: Apache-2.0
// Curriculum over time for models with one canonical pose: first the pose, from the views at the
// time with most images, then views further and further away in time. Large motion is tracked
// outwards from where the pose is known, not searched at all times at once.
#pragma once
#include "optim/options/train_options.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// Schedule of the curriculum in training steps. The default is none: all views from the start.
struct Curriculum {
  int warmup = 0;      // steps before motion is trained
  double steps = 0;    // steps of the curriculum after warm-up
  int iterations = 1;  // training steps in total

  // The curriculum of the settings for permanent motion models, none for others.
  static Curriculum of(const TrainOptions& config, bool permanent);

  bool warming(int step) const { return step < warmup; }
  // Progress of the curriculum, 0 to 1.
  double share(int step) const;
  // Progress of the training after the curriculum, 0 to 1; the learning rates of motion stay
  // constant until then.
  double share_after(int step) const;
  // Index of the view that a step uses, of n views sorted by distance in time from
  // moment_to_begin(). During the curriculum odd turns choose among all views so far, even turns
  // among the outermost of them.
  size_t view_at(size_t n, int step, uint32_t seed, size_t turn) const;
};

// The time, in [0, 1], with most images; of several the one nearest to the middle of the video. 0.5
// if all times have equally many.
double moment_to_begin(const std::vector<Frame>& frames);

// Shuffled order of training views: item i of an endless sequence that contains each of n items
// once per round, newly shuffled every round. Deterministic in (seed, i).
size_t shuffled(size_t n, uint32_t seed, size_t i);

}  // namespace gflow
