// SPDX-License-Identifier: Apache-2.0
// The part of a training step that looks from elsewhere: which views, what the guidance says of
// them, and its gradients back into the model. A function of configuration, seed and step number,
// as far as the guidance is one of the request.
#pragma once
#include <functional>
#include <limits>
#include <vector>

#include "optim/guidance/guidance.hpp"
#include "optim/guidance/orbit.hpp"
#include "optim/loss/flow_loss.hpp"
#include "optim/model/renderer.hpp"
#include "optim/scene/frame_store.hpp"
#include "optim/train/options.hpp"

namespace gflow {

// NaN where there was none.
struct GuideFigures {
  // Mean over pixel values and views of |weight x gradient|, without guidance.weight.
  double pull = std::numeric_limits<double>::quiet_NaN();
  // Of the flow that was wanted, in the view drawn last [px].
  double flow_epe = std::numeric_limits<double>::quiet_NaN();
};

class Guide {
 public:
  // Error when guidance.cameras names a split without views. All references must outlive it.
  Guide(Queue& queue, const TrainConfig& config, const Scene& scene, FrameStore& frames,
        Guidance& guidance);

  // Whether a step has guidance.
  bool due(int step) const;

  struct Moment {
    const Frame* frame = nullptr;  // what the step trains on: time and reference
    std::array<uint8_t, 3> background = {255, 255, 255};  // sRGB
    int sh_degree = 0;
  };
  // Draws the views of a step, asks, and adds the gradients to model.parameters. The loss is
  //   mean over views of (guidance.weight w <gradient, rgb> / (3 H W) + guidance.flow w_f L_flow).
  // after(shot): called when the gradients of a view are in `renderer`. GuidanceFailed before
  // anything of the model is touched.
  void run(Queue& queue, Model& model, Renderer& renderer, int step, const Moment& moment,
           const std::function<void(const Shot&)>& after);

  // Of the last run(). Waits.
  GuideFigures figures(Queue& queue);

 private:
  GuidanceRequest request_for(int step, const Moment& moment) const;
  Camera camera_for(int step, int view, const Frame& frame) const;
  Shot shot_of(const GuidanceRequest& request, const GuidanceView& view,
               const Moment& moment) const;
  void set_gradients(Queue& queue, const Images& images, const GuidanceAnswer& answer);

  const TrainConfig& config_;
  const Scene& scene_;
  FrameStore& frames_;
  Guidance& guidance_;
  Orbit orbit_;
  std::vector<double> times_;  // of the time steps, rising
  FlowLoss flow_loss_;
  ImageGradients v_;
  Buffer<float> target_flow_{"wanted flow"};
  Buffer<cl_uchar> confidence_{"confidence of the wanted flow"};
  double pull_ = std::numeric_limits<double>::quiet_NaN();
  bool had_flow_ = false;
};

}  // namespace gflow
