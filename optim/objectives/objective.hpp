// SPDX-License-Identifier: Apache-2.0
// Interface of losses. An objective is one or several terms of the training loss: it requests what
// a view must render, adds gradients once it is rendered, and reports named values. Log, CSV and
// progress line print all reported values.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "optim/formats/npz.hpp"
#include "optim/images/rect.hpp"
#include "optim/model/renderer.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// One named value of a training step.
struct Term {
  std::string name;      // column in metrics.jsonl and metrics.csv
  double value = 0;      // NaN: not evaluated in this step
  std::string progress;  // text in the progress line, e.g. "psnr 31.2"; "": not shown
};

// Values that the objectives report for the last training step.
struct LossReport {
  double loss = 0;  // sum of all weighted terms
  std::vector<Term> terms;

  // Value of a term; NaN if there is none of that name.
  double value(const std::string& name) const;
};

// One view of a training step.
struct Sample {
  const Frame* frame = nullptr;  // the image to compare with
  int pair = -1;                 // index of its target flow; -1: none
  Rect part;                     // the part of the image that is rendered [px]
};

// Data of a training step for all objectives.
struct StepContext {
  int step = 0;                         // from 0
  const Frame* frame = nullptr;         // of the first view
  std::array<uint8_t, 3> background{};  // behind images with alpha, sRGB
  int sh_degree = 0;                    // highest band of spherical harmonics in use
};

// Data of one view of a training step.
struct ViewContext : StepContext {
  int in_batch = 0;  // index of the view in its step
  Sample sample;
  int width = 0, height = 0;  // of the whole image [px]
  float share = 1;            // pixels rendered / pixels of the whole image; scales image losses
};

// For objectives that render views of their own.
struct NovelViews {
  Queue& queue;
  Model& model;
  Renderer& renderer;
  // Call it after each Renderer::backward.
  std::function<void(const Shot&)> after_backward;
};

class Objective {
 public:
  virtual ~Objective() = default;

  // Before the first view of a step.
  virtual void begin_step(Queue&, const StepContext&) {}
  // Renders views of its own and adds their gradients to the model's. Called before the step's
  // views.
  virtual void add_novel_views(NovelViews&, const StepContext&) {}
  // Before a view is rendered: requests what it must contain (flow, depth, poses at more times).
  // Uploads may begin here.
  virtual void request(Queue&, const ViewContext&, Shot&) {}
  // After the view is rendered: adds d loss / d image, [3, H, W] for v_rgb, [H, W] for v_alpha and
  // v_depth, [2, H, W] for v_flow; the latter two are empty unless the view was requested with
  // them. Objectives run in order, first gflow's own (image, flow): what earlier ones have added
  // must be kept.
  virtual void add_gradients(Queue&, const ViewContext&, const Renderer&, ImageGradients&) {}
  // After that: adds d loss / d pose, which holds the gradients of the images already. Gradients at
  // the other times are there if the view was requested with them (Shot::pose_t2, pose_t0); row i
  // is Gaussian i then. Only those of Gaussians drawn (Splats::tiles_touched > 0) count.
  virtual void add_pose_gradients(Queue&, const ViewContext&, const Renderer&, GaussianGradients&) {
  }

  // On several devices, add_gradients() of a view runs on one of them. take_view() removes from
  // this objective what it left there for later views and steps; give_view() puts it into those of
  // every device, in the order of the views, before add_pose_gradients().
  virtual std::vector<float> take_view(Queue&, const ViewContext&) { return {}; }
  virtual void give_view(Queue&, const ViewContext&, const std::vector<float>&) {}

  // After the last view of a step.
  virtual void end_step(Queue&, const StepContext&) {}

  // Appends its terms of the last step to the report and adds them to its loss. Waits for the
  // queue.
  virtual void report(Queue&, const Renderer&, LossReport&) = 0;

  // Called after rows of the model were added, removed or reordered.
  virtual void rows_changed() {}
  // State that a checkpoint must contain, under names of its own. Error if loaded arrays do not
  // fit; path: their file, for messages.
  virtual void save_state(Queue&, Arrays&) {}
  virtual void load_state(Queue&, const Arrays&, const std::string& path) { (void)path; }
};

}  // namespace gflow
