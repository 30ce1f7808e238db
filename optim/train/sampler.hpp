// SPDX-License-Identifier: Apache-2.0
// What a training step looks at: views, the parts of them that are drawn, the flow they are
// compared by. A function of configuration, scene, seed and step number alone.
#pragma once
#include <algorithm>
#include <vector>

#include "optim/flow/flow_store.hpp"
#include "optim/init/motion_mask.hpp"
#include "optim/train/curriculum.hpp"
#include "optim/train/options.hpp"
#include "optim/train/sequential.hpp"

namespace gflow {

// One view of a step.
struct Sample {
  const Frame* frame;
  int pair;   // index of the flow used, or -1
  Rect part;  // what of it is drawn
};

// Steps of which one has flow (flow.every). A path of few numbers learns as much from flow in every
// second one: optim/loss/README.md.
inline int steps_to_flow(const FlowConfig& flow, MotionModelKind motion) {
  if (flow.every > 0) return flow.every;
  return has_stiff_paths(motion) ? 2 : 1;
}

class Sampler {
 public:
  // As for the Trainer; shape: of the model that is trained. Error where train.sequential does not
  // go with it (require_sequence). All references must outlive it.
  Sampler(const TrainConfig& config, const Scene& scene, const FrameStore& frames,
          const std::vector<FlowPair>& pairs, const FlowStore& flows, std::vector<Rect> parts,
          const MotionShape& shape);

  // The views of step number `step`, from 0.
  std::vector<Sample> at(int step) const;
  // Which time steps a training step is about.
  Stage stage(int step) const { return stage_at(config_.train, std::max(scene_.steps, 1), step); }
  const Unfolding& unfolding() const { return unfolding_; }
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
  // to a neighbour or further (flow.far_share), or -1.
  int pair_at(size_t frame, int step, size_t turn) const;

  const TrainConfig& config_;
  const Scene& scene_;
  const FrameStore& frames_;
  std::vector<Rect> parts_;
  Unfolding unfolding_;
  int flow_every_ = 1;
  std::vector<Choice> choices_;
  std::vector<Ways> ways_;  // one a training frame
};

}  // namespace gflow
