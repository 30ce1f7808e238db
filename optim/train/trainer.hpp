// SPDX-License-Identifier: Apache-2.0
// The training step: samples, views, optimiser. What a step does is a function of options, seed and
// step number alone.
#pragma once
#include <string>
#include <vector>

#include "optim/train/make_objectives.hpp"
#include "optim/train/optimizer.hpp"
#include "optim/train/sampler.hpp"
#include "optim/train/seat.hpp"
#include "optim/train/view_pass.hpp"

namespace gflow {

// Report of a training step; read back on request only.
struct StepReport : LossReport {
  size_t gaussians = 0, moving = 0;
  size_t rejected = 0;  // rows of any table with a rejected (non-finite) gradient so far
  size_t stuck = 0;     // rows shared by all Gaussians whose last ten gradients were all non-finite
  // Result of non_finite_array() on the state, if it was checked: before saving.
  std::string non_finite;
};

class Trainer {
 public:
  // parts[i] is the focus region of scene.train[i] (train.focus), empty for none. more: further
  // objectives.
  Trainer(const TrainInputs& inputs, std::vector<Rect> parts,
          const std::vector<MakeObjective>& more = {});
  // Waits, because the device may still read uploads of a step.
  ~Trainer();
  Trainer(const Trainer&) = delete;
  Trainer& operator=(const Trainer&) = delete;

  // From now on this device trains with others, whose trainers are in the same state. The leader's
  // step() and set_state() tell them what to do, the others call follow().
  void join(Seat& seat) { seat_ = &seat; }
  // Makes what the leader makes, until it ends.
  void follow(Queue& queue);

  // Makes step number `step`, from 0. GuidanceFailed leaves everything as it was before the step.
  void step(Queue& queue, int step);
  // Whether a step that threw has left everything that state() saves unchanged.
  bool untouched() const { return untouched_; }
  // Waits.
  StepReport report(Queue& queue);
  // The report's counts of Gaussians and rows, which need no image. Waits.
  StepReport counts(Queue& queue);
  // Message to the user about an event since the last call, or "".
  std::string take_notice();

  // Everything that a later step depends on, besides options, scene and step number. Waits.
  Arrays state(Queue& queue);
  // Continues from a saved state, whatever the model was. Error if the arrays do not fit the model;
  // `path`: their file, for messages.
  void set_state(Queue& queue, const Arrays& arrays, const std::string& path);

  // Learning-rate scale; part of the state.
  float rate_scale() const { return optimizer_.rates().scale; }
  void set_rate_scale(float scale) { optimizer_.rates().scale = scale; }

  // Highest band of spherical harmonics in use at a step.
  int sh_degree(int step) const;
  // Time steps that a training step trains.
  Stage stage(int step) const { return sampler_.stage(step); }
  // State after the last view of the last step.
  const Renderer& renderer() const { return view_pass_.renderer(); }
  const ImageGradients& image_gradients() const { return view_pass_.image_gradients(); }
  const Model& model() const { return in_.model; }
  const Scene& scene() const { return in_.scene; }

 private:
  void make_step(Queue& queue, int step);
  void apply_state(Queue& queue, const Arrays& arrays, const std::string& path);
  // The views of a step, all of them on this device or divided over several.
  void run_views(Queue& queue, const StepContext& context, const std::vector<Sample>& samples);
  void run_divided_views(Queue& queue, const StepContext& context,
                         const std::vector<Sample>& samples);
  // Density control sees the view that was just added.
  void see(Queue& queue, const Sample& sample);

  // Loads images and flow of the next step in the background; if flow is computed, that of several
  // steps.
  void prefetch(int step);
  // Background of images with alpha, sRGB.
  std::array<uint8_t, 3> background(int step) const;

  TrainInputs in_;
  Sampler sampler_;
  ViewPass view_pass_;
  Optimizer optimizer_;
  Reduce reduce_;
  Seat* seat_ = nullptr;   // nullptr: this device trains alone
  bool untouched_ = true;  // by the current step
  bool warned_of_emptiness_ = false;
};

}  // namespace gflow
