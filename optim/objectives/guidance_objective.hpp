// SPDX-License-Identifier: Apache-2.0
// Guidance of novel views: chooses the views of a step, asks the provider, and adds its gradients
// (settings guidance.*). A function of options, seed and step number if the provider is a function
// of the request.
#pragma once
#include <limits>
#include <vector>

#include "optim/guidance/guidance.hpp"
#include "optim/guidance/orbit.hpp"
#include "optim/loss/flow_loss.hpp"
#include "optim/objectives/objective.hpp"
#include "optim/options/train_options.hpp"
#include "optim/scene/frame_store.hpp"

namespace gflow {

class GuidanceObjective : public Objective {
 public:
  // Error if guidance.cameras names a split without views. All references must outlive it.
  GuidanceObjective(Queue& queue, const TrainOptions& config, const Scene& scene,
                    FrameStore& frames, Guidance& guidance);

  // In a step with guidance: renders its views, asks the provider, and adds the gradients of
  //   mean over views of (guidance.weight w <gradient, rgb> / (3 H W) + guidance.flow w_f L_flow).
  // Throws GuidanceFailed before anything in the model is changed.
  void add_novel_views(NovelViews& views, const StepContext& context) override;
  // Reports guidance: mean over pixel values and views of |weight x gradient|, without
  // guidance.weight; and guidance_flow_epe: error against the provider's flow in the last rendered
  // view [px]. NaN before the first.
  void report(Queue& queue, const Renderer& renderer, LossReport& report) override;

 private:
  bool is_due(int step) const;
  GuidanceRequest request_for(const StepContext& context) const;
  Camera camera_for(int step, int view, const Frame& frame) const;
  Shot shot_of(const GuidanceRequest& request, const GuidanceView& view, int sh_degree) const;
  void set_gradients(Queue& queue, const Images& images, const GuidanceAnswer& answer);

  const TrainOptions& config_;
  const Scene& scene_;
  FrameStore& frames_;
  Guidance& guidance_;
  Orbit orbit_;
  std::vector<double> times_;  // of the time steps, ascending
  FlowLoss flow_loss_;
  ImageGradients v_;
  Buffer<float> target_flow_{"target flow of guidance"};
  Buffer<cl_uchar> confidence_{"confidence of that flow"};
  double strength_ = std::numeric_limits<double>::quiet_NaN();
  bool had_flow_ = false;
};

}  // namespace gflow
