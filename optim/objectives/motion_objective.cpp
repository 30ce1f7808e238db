// SPDX-License-Identifier: Apache-2.0
#include "optim/objectives/motion_objective.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace gflow {

// A loss in every n-th step has n times the weight.
std::unique_ptr<MotionObjective> MotionObjective::make(Queue& queue, const LossOptions& options,
                                                       int steps, float extent, Model& model) {
  MotionLossWeights w;
  static_cast<LossOptions&>(w) = options;
  for (float* weight : {&w.rigidity, &w.rotation, &w.isometry, &w.velocity, &w.acceleration})
    *weight *= float(options.motion_every);
  w.extent = extent;
  if (steps < 2 || !(w.any_pairs() || w.acceleration > 0)) return nullptr;
  return std::make_unique<MotionObjective>(queue, options, steps, w, model);
}

MotionObjective::MotionObjective(Queue& queue, const LossOptions& options, int steps,
                                 const MotionLossWeights& weights, Model& model)
    : options_(options), steps_(steps), model_(model), loss_(queue, weights) {}

void MotionObjective::begin_step(Queue& queue, const StepContext& context) {
  if (!loss_.weights().any_pairs()) return;
  if (neighbours_known_ && context.step % options_.neighbours_every != 0) return;
  // Each Gaussian searches near its temporal mean; ten times of the video are enough to
  // distinguish.
  const NeighbourRule rule{size_t(options_.neighbours), model_.shape.duration,
                           size_t(std::min(steps_, 10))};
  loss_.set_pairs(queue, find_neighbours(queue, model_.parameters, *model_.motion, rule));
  neighbours_known_ = true;
}

void MotionObjective::request(Queue&, const ViewContext& view, Shot& shot) {
  in_last_view_ = view.step % options_.motion_every == 0;
  if (!in_last_view_) return;
  shot.pose_t2 = true;
  if (loss_.weights().acceleration > 0) shot.pose_t0 = true;
}

void MotionObjective::add_pose_gradients(Queue& queue, const ViewContext&, const Renderer& renderer,
                                         GaussianGradients& v) {
  if (!in_last_view_) return;
  loss_.run(queue, renderer.engine().splats().tiles_touched, renderer.gaussians_t0(),
            renderer.gaussians(), renderer.gaussians_t2(), v);
}

void MotionObjective::report(Queue& queue, const Renderer&, LossReport& report) {
  const double nan = std::nan("");
  const MotionLossValue value =
      in_last_view_ ? loss_.value(queue) : MotionLossValue{nan, nan, nan, nan, nan};
  if (in_last_view_) report.loss += value.total();
  const std::string shown = in_last_view_ ? fmt::format("motion {:.4f}", value.total()) : "";
  report.terms.push_back({"rigidity", value.rigidity, shown});
  report.terms.push_back({"rotation", value.rotation, ""});
  report.terms.push_back({"isometry", value.isometry, ""});
  report.terms.push_back({"velocity", value.velocity, ""});
  report.terms.push_back({"acceleration", value.acceleration, ""});
}

void MotionObjective::save_state(Queue&, Arrays& arrays) {
  if (neighbours_known_) gflow::save_state(loss_.pairs(), arrays);
}

void MotionObjective::load_state(Queue& queue, const Arrays& arrays, const std::string& path) {
  neighbours_known_ = arrays.count("neighbours/offsets");
  if (neighbours_known_)
    loss_.set_pairs(queue, load_neighbours(arrays, model_.parameters.count, path));
}

}  // namespace gflow
