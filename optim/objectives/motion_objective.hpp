// SPDX-License-Identifier: Apache-2.0
// Regularisers of motion among neighbouring Gaussians (settings loss.rigidity to
// loss.motion_every).
#pragma once
#include "optim/loss/motion_loss.hpp"
#include "optim/objectives/objective.hpp"
#include "optim/options/train_options.hpp"

namespace gflow {

class MotionObjective : public Objective {
 public:
  // nullptr if all weights are 0 or the scene has one time step. steps: time steps of the scene;
  // extent: of the scene [scene units]. The references must outlive it.
  static std::unique_ptr<MotionObjective> make(Queue& queue, const LossOptions& options, int steps,
                                               float extent, Model& model);
  MotionObjective(Queue& queue, const LossOptions& options, int steps,
                  const MotionLossWeights& weights, Model& model);

  // Updates the neighbours when due.
  void begin_step(Queue& queue, const StepContext& context) override;
  void request(Queue& queue, const ViewContext& view, Shot& shot) override;
  void add_pose_gradients(Queue& queue, const ViewContext& view, const Renderer& renderer,
                          GaussianGradients& v) override;
  // Reports rigidity, rotation, isometry, velocity and acceleration of the last view, weighted; NaN
  // in a step without them (loss.motion_every).
  void report(Queue& queue, const Renderer& renderer, LossReport& report) override;
  void rows_changed() override { neighbours_known_ = false; }
  void save_state(Queue& queue, Arrays& arrays) override;
  void load_state(Queue& queue, const Arrays& arrays, const std::string& path) override;

 private:
  const LossOptions& options_;
  int steps_;
  Model& model_;
  MotionLoss loss_;
  bool neighbours_known_ = false;
  bool in_last_view_ = false;
};

}  // namespace gflow
