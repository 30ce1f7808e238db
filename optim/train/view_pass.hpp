// SPDX-License-Identifier: Apache-2.0
// One view of a training step on one device: renders it, lets the objectives compare, and adds the
// gradients to the model's parameters, in the order of the views. When several devices train, each
// has a pass and a model: it renders some of the views, and adds the gradients of all.
#pragma once
#include <memory>
#include <vector>

#include "optim/objectives/objective.hpp"
#include "optim/scene/frame_store.hpp"
#include "optim/train/view_record.hpp"

namespace gflow {

class ViewPass {
 public:
  // All references must outlive it. near: Gaussians closer to the camera are skipped [scene units].
  // time_steps: of the scene.
  ViewPass(Queue& queue, const EngineSettings& settings, float near, int time_steps,
           FrameStore& frames, Model& model, std::vector<std::unique_ptr<Objective>> objectives);

  // Before the first view of a step.
  void begin_step(Queue& queue, const StepContext& context);
  // Renders the novel views of objectives; after_backward is called with each view's gradients.
  void run_novel_views(Queue& queue, const StepContext& context,
                       const std::function<void(const Shot&)>& after_backward);
  // Renders one view of the step. Its gradients are in renderer() until the next call. all_posed:
  // density control needs Gaussians outside the image, too.
  void run(Queue& queue, const StepContext& context, const Sample& sample, int in_batch,
           bool all_posed);

  // The two halves of run(), for several devices: one renders the view and gets its gradients by
  // the poses, each adds them to the parameters. Between them other views may be rendered.
  ViewRecord render(Queue& queue, const StepContext& context, const Sample& sample, int in_batch,
                    bool all_posed);
  void add(Queue& queue, const StepContext& context, const Sample& sample, int in_batch,
           const ViewRecord& record);

  // After the last view of a step.
  void end_step(Queue& queue, const StepContext& context);

  // Renders a frame and sets v_colors of renderer().gradients() to the sums of the Gaussians'
  // weights over its pixels.
  void weigh(Queue& queue, const Frame& frame);

  // What the objectives report of the last step. Waits.
  LossReport report(Queue& queue);
  void rows_changed();
  void save_state(Queue& queue, Arrays& arrays);
  void load_state(Queue& queue, const Arrays& arrays, const std::string& path);

  // State after the last view.
  const Renderer& renderer() const { return renderer_; }
  const ImageGradients& image_gradients() const { return v_; }  // v_flow is stale without flow
  // Number of consecutive views, up to the last one, in which no Gaussian was visible.
  int empty_views() const { return empty_views_; }

 private:
  ViewContext context_of(const StepContext& context, const Sample& sample, int in_batch) const;
  Shot shot_of(const ViewContext& view) const;
  // Renders a view as the objectives request it, and sets the gradients of its poses.
  Shot compare(Queue& queue, const ViewContext& view, bool all_posed);
  void add_to_parameters(Queue& queue, const ViewContext& view, GaussianGradients& poses,
                         size_t intersections);

  float near_;
  int time_steps_;
  FrameStore& frames_;
  Model& model_;
  Renderer renderer_;
  std::vector<std::unique_ptr<Objective>> objectives_;
  ImageGradients v_;
  Buffer<float> tiles_{"flow tiles of a view"};  // of another device
  int empty_views_ = 0;
};

}  // namespace gflow
