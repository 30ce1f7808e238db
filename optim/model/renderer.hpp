// SPDX-License-Identifier: Apache-2.0
// Renders a model from a camera at a time: motion, colour, engine, and the backward pass to the
// parameters. Training, evaluation and rendering use it.
#pragma once
#include "optim/engine/engine.hpp"
#include "optim/model/model.hpp"
#include "optim/scene/camera.hpp"

namespace gflow {

// Converts to the engine's camera; near_plane in scene units.
PinholeCamera pinhole(const Camera& camera, float near_plane);

// What to render. Times are scene times, in [0, 1].
struct Shot {
  View view;
  double time = 0;
  double time_t2 = 0;  // target time of the flow, second time of losses on poses
  bool flow = false, depth = false;
  // For losses on poses: every Gaussian drawn is also posed at time_t2, and at time_t0() if that is
  // within the video; pose_t0 needs pose_t2. Both list every row, as all_posed.
  bool pose_t2 = false, pose_t0 = false;
  bool all_posed = false;  // no culling: rows() lists every row of the model
  int sh_degree = 3;  // highest band of spherical harmonics in use; limited to what the model has
  std::array<float, 3> background = {1, 1, 1};

  double time_t0() const { return 2 * time - time_t2; }  // as long before `time` as time_t2 after
};

class Renderer {
 public:
  Renderer(Queue& queue, const EngineSettings& settings)
      : engine_(queue, settings), skip_(settings.skip), rows_(queue) {}

  void forward(Queue& queue, Model& model, const Shot& shot);
  // The part of forward() that backward_to_parameters() needs: poses, and which Gaussians are
  // visible. For a view that another device has rendered, whose gradients() follow by
  // begin_gradients().
  void pose(Queue& queue, Model& model, const Shot& shot);
  // After pose(): the gradients of the poses in the right sizes, to be written by the caller; those
  // of times that the images do not depend on are 0.
  GaussianGradients& begin_gradients(Queue& queue);
  // Backward pass of the last forward(): gradients of sum(images . v) to model.parameters, set for
  // rows not seen before in this training step, added for the others. Marks rows as seen.
  void backward(Queue& queue, Model& model, const ImageGradients& v) {
    backward_to_poses(queue, v);
    backward_to_parameters(queue, model);
  }
  // Its first half: sets the gradients of the poses, those of times that the images do not depend
  // on to 0. Losses on poses add theirs to it before the second half.
  GaussianGradients& backward_to_poses(Queue& queue, const ImageGradients& v);
  void backward_to_parameters(Queue& queue, Model& model);

  const Images& images() const { return engine_.images(); }
  // Rows of the last view, after culling or all (Shot::all_posed). All arrays below have one entry
  // per listed row.
  const ViewRows& rows() const { return rows_; }
  // Poses at the last rendered time; an entry is set if its opacity is not 0.
  const GaussiansAt& gaussians() const { return t1_; }
  // Poses at shot().time_t2 of the entries with_second_time(), with flow or pose_t2 only.
  const GaussiansAt& gaussians_t2() const { return t2_; }
  // Poses at shot().time_t0() of the Gaussians drawn; nullptr without (Shot::pose_t0).
  const GaussiansAt* gaussians_t0() const { return has_t0() ? &t0_ : nullptr; }
  const Engine& engine() const { return engine_; }
  const GaussianGradients& gradients() const { return gradients_; }
  GaussianGradients& gradients() { return gradients_; }
  // Whether static Gaussians kept their pose in the last view with flow (View::moving).
  bool stood_still() const { return shot_.view.moving < all_rows; }
  const Shot& shot() const { return shot_; }  // of the last forward()
  // Entries, below shot().view.moving, whose pose at the second time matters.
  const Buffer<cl_uint>& with_second_time() const;

 private:
  // Sets the rows that a view may show.
  void cull(Queue& queue, Model& model, const Shot& shot);
  // The listed rows whose pose differs at the second time.
  RowList moving_rows() const;
  Bands bands(const Model& model) const;
  bool has_t0() const;
  void zero_other_times(Queue& queue);

  Engine engine_;
  Skips skip_;
  ViewRows rows_;
  Shot shot_;
  GaussiansAt t0_, t1_, t2_;
  Buffer<float> colors_{"colors"};
  GaussianGradients gradients_;
};

}  // namespace gflow
