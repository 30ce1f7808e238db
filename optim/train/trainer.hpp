// SPDX-License-Identifier: Apache-2.0
// The training step, and nothing around it: samples, views, optimiser. What a step does is a
// function of options, seed and step number alone.
#pragma once
#include <string>
#include <vector>

#include "optim/train/objectives.hpp"
#include "optim/train/optimizer.hpp"
#include "optim/train/sampler.hpp"
#include "optim/train/view_pass.hpp"

namespace gflow {

// The state of a training after a step; read back only when asked for.
struct StepReport : LossReport {
  size_t gaussians = 0, moving = 0;
  size_t rejected = 0;  // rows whose gradients were rejected as non-finite so far, of any table
  size_t stuck = 0;     // rows shared by all Gaussians whose last ten gradients were all non-finite
  // non_finite_array() of the state, where that was checked: before something of it is kept.
  std::string non_finite;
};

class Trainer {
 public:
  // parts[i] is the part of scene.train[i] that gets extra steps (train.focus), empty for none.
  // more: further objectives.
  Trainer(const TrainInputs& inputs, std::vector<Rect> parts,
          const std::vector<MakeObjective>& more = {});
  // Waits: the device may still read what a step has uploaded.
  ~Trainer();
  Trainer(const Trainer&) = delete;
  Trainer& operator=(const Trainer&) = delete;

  // Step number `step`, from 0. GuidanceFailed leaves everything as it was before the step.
  void step(Queue& queue, int step);
  // Whether a step that threw has left all that state() saves as it was before the step.
  bool untouched() const { return untouched_; }
  // Waits.
  StepReport report(Queue& queue);
  // Its counts of Gaussians and rows alone, which need no image. Waits.
  StepReport counts(Queue& queue);
  // A sentence for the user about something that happened since the last call, or "".
  std::string take_notice();

  // All that a later step depends on beside options, scene and step number. Waits.
  Arrays state(Queue& queue);
  // Continues from there, whatever the model was. Error when the arrays are not those of such a
  // model; `path`: the file they come from, for messages.
  void set_state(Queue& queue, const Arrays& arrays, const std::string& path);

  // What all learning rates are multiplied by; part of the state.
  float rate_scale() const { return optimizer_.rates().scale; }
  void set_rate_scale(float scale) { optimizer_.rates().scale = scale; }

  // Bands of spherical harmonics in use at a step.
  int sh_degree(int step) const;
  // Which time steps a training step is about.
  Stage stage(int step) const { return sampler_.stage(step); }
  // As after the last view of the last step.
  const Renderer& renderer() const { return view_pass_.renderer(); }
  const ImageGradients& image_gradients() const { return view_pass_.image_gradients(); }
  const Model& model() const { return in_.model; }

 private:
  // Loads images and flow of the next step in the background; flow that must be computed, of
  // several steps.
  void prefetch(int step);
  // Behind images with alpha, sRGB.
  std::array<uint8_t, 3> background(int step) const;

  TrainInputs in_;
  Sampler sampler_;
  ViewPass view_pass_;
  Optimizer optimizer_;
  Reduce reduce_;
  bool untouched_ = true;  // by the step under way
  bool warned_of_emptiness_ = false;
};

}  // namespace gflow
