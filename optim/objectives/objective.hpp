// SPDX-License-Identifier: Apache-2.0
// The seam for losses. An objective is one term, or a family of terms, of the training loss: it
// says what a view must show, adds gradients once the view is drawn, and reports named values. Log,
// CSV and progress line print whatever is reported.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "optim/formats/npz.hpp"
#include "optim/init/motion_mask.hpp"
#include "optim/model/renderer.hpp"

namespace gflow {

// One named value of a training step.
struct Term {
  std::string name;      // column of metrics.jsonl and metrics.csv
  double value = 0;      // NaN: not evaluated in this step
  std::string progress;  // as the progress line shows it, e.g. "psnr 31.2"; "": not there
};

// What the objectives report of the last training step.
struct LossReport {
  double loss = 0;  // sum of all weighted terms
  std::vector<Term> terms;

  // The value of a term; NaN where there is none of that name.
  double value(const std::string& name) const;
};

// One view of a training step.
struct Sample {
  const Frame* frame = nullptr;  // the image it is compared with
  int pair = -1;                 // index of its target flow; -1: none
  Rect part;                     // the part of the image that is drawn [px]
};

// What all objectives know about a training step.
struct StepContext {
  int step = 0;                         // from 0
  const Frame* frame = nullptr;         // of the first view
  std::array<uint8_t, 3> background{};  // behind images with alpha, sRGB
  int sh_degree = 0;                    // bands of spherical harmonics in use
};

// What they know about a view of it.
struct ViewContext : StepContext {
  int in_batch = 0;  // number of the view in its step
  Sample sample;
  int width = 0, height = 0;  // of the whole image [px]
  float share = 1;            // pixels drawn / pixels of the whole image; scales image losses
};

// For objectives that draw views of their own.
struct NovelViews {
  Queue& queue;
  Model& model;
  Renderer& renderer;
  // To be called after each Renderer::backward.
  std::function<void(const Shot&)> after_backward;
};

class Objective {
 public:
  virtual ~Objective() = default;

  // Before the first view of a step.
  virtual void begin_step(Queue&, const StepContext&) {}
  // Draws views of its own and adds their gradients to the model's; comes before the step's views.
  virtual void add_novel_views(NovelViews&, const StepContext&) {}
  // Before a view is drawn: asks for what the view must show (flow, depth, a second time, a loss on
  // Gaussians). Uploads may begin here.
  virtual void request(Queue&, const ViewContext&, Shot&) {}
  // After it is drawn: adds d loss / d image. v.v_alpha starts at 0. The image objective comes
  // first and sets v.v_rgb, the flow objective sets v.v_flow of views with flow; others add to
  // them.
  virtual void add_gradients(Queue&, const ViewContext&, const Renderer&, ImageGradients&) {}

  // Appends its terms of the last step, and adds them to the loss. Waits for the queue.
  virtual void report(Queue&, const Renderer&, LossReport&) = 0;

  // The rows of the model were added, removed or reordered.
  virtual void rows_changed() {}
  // State that a checkpoint must hold, by names of its own. Error when loaded arrays do not fit;
  // path: their file, for messages.
  virtual void save_state(Queue&, Arrays&) {}
  virtual void load_state(Queue&, const Arrays&, const std::string& path) { (void)path; }
};

}  // namespace gflow
