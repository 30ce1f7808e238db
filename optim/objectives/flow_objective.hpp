// SPDX-License-Identifier: Apache-2.0
// Compares the rendered flow of a view with its target flow (settings flow.*).
#pragma once
#include <memory>

#include "optim/flow/flow_store.hpp"
#include "optim/loss/flow_loss.hpp"
#include "optim/loss/flow_tiles.hpp"
#include "optim/objectives/objective.hpp"
#include "optim/options/train_options.hpp"
#include "optim/scene/frame_store.hpp"

namespace gflow {

// Number of steps from one with flow to the next (flow.every). For paths of few parameters every
// second step is as good: optim/loss/README.md.
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
  // flow_loss and flow_epe [px] of the last view with flow. Both are estimated from the evaluated
  // tiles (flow.low_motion); flow_loss is weighted by flow.weight, regardless of flow.every. NaN if
  // no tile was evaluated, 0 without flow.
  void report(Queue& queue, const Renderer& renderer, LossReport& report) override;
  void save_state(Queue& queue, Arrays& arrays) override;
  void load_state(Queue& queue, const Arrays& arrays, const std::string& path) override;

 private:
  struct Values {
    bool known = false;  // at least one tile was evaluated
    float loss = 0, epe = 0;
  };
  // Uploads the target flow of a view and its confidence; sets weight_.
  void upload_target(Queue& queue, const ViewContext& view);
  // Values of the last view with flow. Waits.
  Values values(Queue& queue);

  const TrainOptions& options_;
  const Scene& scene_;
  FrameStore& frames_;
  const std::vector<FlowPair>& pairs_;
  FlowStore& flows_;
  int every_;
  FlowLoss loss_;
  std::unique_ptr<FlowTiles> tiles_;  // nullptr: all tiles are evaluated in every step
  float weight_ = 0;
  bool in_parts_ = false;      // much of the view has no target flow
  std::vector<float> planes_;  // source of asynchronous writes
  std::vector<cl_uchar> confidence_bytes_;
  std::vector<cl_uchar> counted_bytes_;
  Buffer<float> target_{"target flow"};
  Buffer<cl_uchar> confidence_{"confidence"};
  bool had_flow_ = false;  // whether the last view had flow
  bool is_new_ = false;    // values_ must be read again
  Values values_;
};

}  // namespace gflow
