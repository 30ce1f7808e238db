// SPDX-License-Identifier: Apache-2.0
// A model seen by a camera at a time: motion -> colour -> engine, and back to the parameters'
// gradients. Training, evaluation and rendering all draw through this.
#pragma once
#include "optim/engine/engine.hpp"
#include "optim/loss/motion_loss.hpp"
#include "optim/model/model.hpp"
#include "optim/scene/camera.hpp"

namespace gflow {

// The engine's camera; near_plane in scene units.
PinholeCamera pinhole(const Camera& camera, float near_plane);

// What to draw. Times are the scene's, in [0, 1].
struct Shot {
  View view;
  double time = 0;
  double time_t2 = 0;  // with flow: where the flow leads; with a motion loss: its second moment
  bool flow = false, depth = false;
  MotionLoss* motion_loss = nullptr;  // joins the backward pass
  bool all_posed = false;             // rows() are all of the model's
  int sh_degree = 3;                  // bands in use; at most what the model has
  std::array<float, 3> background = {1, 1, 1};
};

class Renderer {
 public:
  Renderer(Queue& queue, const EngineSettings& settings)
      : engine_(queue, settings), skip_(settings.skip), rows_(queue) {}

  void forward(Queue& queue, Model& model, const Shot& shot);
  // Gradients of sum(images . v) for the last forward(), to model.parameters: set for rows not seen
  // before in this training step, added for the others; rows seen are marked.
  void backward(Queue& queue, Model& model, const ImageGradients& v);

  const Images& images() const { return engine_.images(); }
  // Of the last view, for which all below has entries: those in the picture, or all
  // (Shot::all_posed).
  const ViewRows& rows() const { return rows_; }
  // At the time drawn last; an entry is set where its opacity is not 0.
  const GaussiansAt& gaussians() const { return t1_; }
  const Engine& engine() const { return engine_; }
  const GaussianGradients& gradients() const { return gradients_; }
  // Whether those at rest stood still in the last view with flow (View::moving).
  bool stood_still() const { return shot_.view.moving < all_rows; }
  const Shot& shot() const { return shot_; }  // the last
  // Whose pose at the second time matters, of the entries below shot().view.moving.
  const Buffer<cl_uint>& with_second_time() const;

 private:
  // Which rows a view may show.
  void look(Queue& queue, Model& model, const Shot& shot);
  // Those of them that are elsewhere at the second time.
  RowList moving_rows() const;
  Bands bands(const Model& model) const;
  bool needs_third_time() const;  // whether the motion loss has a third moment within the video
  double time_t0() const { return 2 * shot_.time - shot_.time_t2; }

  Engine engine_;
  Skips skip_;
  ViewRows rows_;
  Shot shot_;
  GaussiansAt t0_, t1_, t2_;
  Buffer<float> colors_{"colors"};
  GaussianGradients gradients_;
};

}  // namespace gflow
