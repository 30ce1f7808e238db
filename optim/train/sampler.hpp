// SPDX-License-Identifier: Apache-2.0
// What a training step looks at: views, the parts of them that are drawn, the flow they are
// compared by. A function of configuration, scene, seed and step number alone.
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
  // As for the Trainer; shape: of the model that is trained. Error where train.sequential does not
  // go with it (require_sequence). All references must outlive it.
  Sampler(const TrainOptions& config, const Scene& scene, const FrameStore& frames,
          const std::vector<FlowPair>& pairs, const FlowStore& flows, std::vector<Rect> parts,
          const MotionShape& shape);

  // The views of step number `step`, from 0.
  std::vector<Sample> at(int step) const;
  // Which time steps a training step is about.
  Stage stage(int step) const { return stage_at(config_.train, std::max(scene_.steps, 1), step); }
  const Curriculum& curriculum() const { return curriculum_; }
  // Steps from one with flow to the next (flow.every).
  int flow_every() const { return flow_every_; }

 private:
  // Training frames to choose from, all and those with a part smaller than the whole, of all time
  // steps or, when trained one after the other, of each; from the moment seen best outwards where
  // the model unfolds.
  struct Choice {
    std::vector<size_t> frames, focus;
  };
  // Flows that lead from a frame, forward and back; far: over several pictures.
  struct Ways {
    std::vector<int> near, far;
  };
  // The flow pair, leading to what is trained already, that a frame is shown with, forward or back,
  // to a neighbour or further (flow.long_share), or -1.
  int pair_at(size_t frame, int step, size_t turn) const;

  const TrainOptions& config_;
  const Scene& scene_;
  const FrameStore& frames_;
  std::vector<Rect> parts_;
  Curriculum curriculum_;
  int flow_every_ = 1;
  std::vector<Choice> choices_;
  std::vector<Ways> ways_;  // one a training frame
};

}  // namespace gflow
