// SPDX-License-Identifier: Apache-2.0
// Samples of each training step: views, the regions that are rendered, and their flow pairs. A
// function of configuration, scene, seed and step number alone.
#pragma once
#include <algorithm>
#include <vector>

#include "optim/flow/flow_store.hpp"
#include "optim/objectives/flow_objective.hpp"
#include "optim/options/train_options.hpp"
#include "optim/train/curriculum.hpp"
#include "optim/train/sequential.hpp"

namespace gflow {

class Sampler {
 public:
  // As for the Trainer; shape: of the trained model. Error if train.sequential does not fit it
  // (require_sequence). All references must outlive it.
  Sampler(const TrainOptions& config, const Scene& scene, const FrameStore& frames,
          const std::vector<FlowPair>& pairs, const FlowStore& flows, std::vector<Rect> parts,
          const MotionShape& shape);

  // The samples of step number `step`, from 0.
  std::vector<Sample> at(int step) const;
  // Time steps that a training step trains.
  Stage stage(int step) const { return stage_at(config_.train, std::max(scene_.steps, 1), step); }
  const Curriculum& curriculum() const { return curriculum_; }

 private:
  // Training frames to choose from: all, and those with a focus region. For all time steps
  // together, or with train.sequential one per time step. With a curriculum sorted by distance in
  // time from moment_to_begin().
  struct Choice {
    std::vector<size_t> frames, focus;
  };
  // Flow pairs of a frame, forward and backward (train.sequential: backward only): to a neighbour,
  // or over several frames.
  struct Ways {
    std::vector<int> near, far;
  };
  // The flow pair for a frame, to a neighbour or further (flow.long_share), or -1.
  int pair_at(size_t frame, int step, size_t turn) const;

  const TrainOptions& config_;
  const Scene& scene_;
  const FrameStore& frames_;
  std::vector<Rect> parts_;
  Curriculum curriculum_;
  int flow_every_ = 1;  // number of steps from one with flow to the next (flow.every)
  std::vector<Choice> choices_;
  std::vector<Ways> ways_;  // one per training frame
};

}  // namespace gflow
