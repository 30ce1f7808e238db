// SPDX-License-Identifier: Apache-2.0
// Gaussian flow of a view against its target flow (settings flow.*).
#pragma once
#include <memory>

#include "optim/flow/flow_store.hpp"
#include "optim/loss/flow_loss.hpp"
#include "optim/loss/flow_tiles.hpp"
#include "optim/objectives/objective.hpp"
#include "optim/options/train_options.hpp"
#include "optim/scene/frame_store.hpp"

namespace gflow {

// Steps from one with flow to the next (flow.every). A path of few parameters learns as much from
// flow in every second step: optim/loss/README.md.
inline int steps_to_flow(const FlowOptions& flow, MotionModelKind motion) {
  if (flow.every > 0) return flow.every;
  return has_stiff_paths(motion) ? 2 : 1;
}

class FlowObjective : public Objective {
 public:
  // flows[i] belongs to pairs[i]. All references must outlive it.
  FlowObjective(Queue& queue, const TrainOptions& options, const Scene& scene, FrameStore& frames,
                const std::vector<FlowPair>& pairs, FlowStore& flows, MotionModelKind motion);

  void request(Queue& queue, const ViewContext& view, Shot& shot) override;
  void add_gradients(Queue& queue, const ViewContext& view, const Renderer& renderer,
                     ImageGradients& v) override;
  // flow_loss and flow_epe [px] of the last view with flow, estimated from the tiles that were
  // evaluated (flow.low_motion) and weighted by flow.weight whatever flow.every: NaN where no tile
  // was, 0 where there is no flow at all.
  void report(Queue& queue, const Renderer& renderer, LossReport& report) override;
  void save_state(Queue& queue, Arrays& arrays) override;
  void load_state(Queue& queue, const Arrays& arrays, const std::string& path) override;

 private:
  struct Values {
    bool known = false;  // a tile was evaluated
    float loss = 0, epe = 0;
  };
  // Uploads the target flow of a view with its confidence; sets weight_.
  void upload_target(Queue& queue, const ViewContext& view);
  // Of the last view with flow. Waits.
  Values values(Queue& queue);

  const TrainOptions& options_;
  const Scene& scene_;
  FrameStore& frames_;
  const std::vector<FlowPair>& pairs_;
  FlowStore& flows_;
  int every_;
  FlowLoss loss_;
  std::unique_ptr<FlowTiles> tiles_;  // nullptr: all tiles count in every step
  float weight_ = 0;
  bool in_parts_ = false;      // much of the view has no target flow
  std::vector<float> planes_;  // what asynchronous writes read from
  std::vector<cl_uchar> confidence_bytes_;
  Buffer<float> target_{"target flow"};
  Buffer<cl_uchar> confidence_{"confidence"};
  bool had_flow_ = false;  // the last view
  bool is_new_ = false;    // values_ are of an earlier view
  Values values_;
};

}  // namespace gflow
