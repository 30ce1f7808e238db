// SPDX-License-Identifier: Apache-2.0
// The training step, and nothing around it: which views, losses, gradients, Adam, density control.
// What a step does is a function of configuration, seed and step number alone.
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "optim/flow/flow_store.hpp"
#include "optim/loss/flow_loss.hpp"
#include "optim/loss/flow_tiles.hpp"
#include "optim/loss/image_loss.hpp"
#include "optim/loss/motion_loss.hpp"
#include "optim/model/renderer.hpp"
#include "optim/train/guide.hpp"
#include "optim/train/learning_rates.hpp"
#include "optim/train/options.hpp"
#include "optim/train/population.hpp"
#include "optim/train/sampler.hpp"

namespace gflow {

// What the last step looked like; read back only when asked for.
struct StepFigures {
  double l1 = 0, ssim = 0, loss = 0;
  double psnr = 0;  // of the last view [dB]
  // Of the last view with flow [1, px], estimated from the tiles that were asked (flow.calm), and
  // by flow.weight however seldom it counts (flow.every): NaN where none was asked, 0 where there
  // is no flow at all.
  double flow_loss = 0, epe = 0;
  // Of the last view, NaN in a step without such a loss (loss.motion_every); none: no training has.
  std::optional<MotionLossValue> motion;
  // Of the last step with guidance; none: no training has.
  std::optional<GuideFigures> guidance;
  size_t gaussians = 0, moving = 0;
  size_t refused = 0;  // rows that had a gradient Adam could not take, so far: of any table
  size_t stuck = 0;    // rows that all Gaussians share with none but such in their last ten steps
  // unsound_array() of the state, where that was looked at: before something of it is kept.
  std::string unsound;
};

class Trainer {
 public:
  // flows[i] belongs to pairs[i]; both may be empty. parts[i] is the part of scene.train[i] that
  // gets extra steps (train.focus), empty for none. guidance: the provider of config.guidance, or
  // nullptr for none. All references must outlive the trainer.
  Trainer(Queue& queue, const TrainConfig& config, const Scene& scene, FrameStore& frames,
          const std::vector<FlowPair>& pairs, FlowStore& flows, std::vector<Rect> parts,
          Model& model, Guidance* guidance = nullptr);
  // Waits: the device may still read what a step has uploaded.
  ~Trainer();
  Trainer(const Trainer&) = delete;
  Trainer& operator=(const Trainer&) = delete;

  // Step number `step`, from 0. GuidanceFailed leaves everything as it was before the step.
  void step(Queue& queue, int step);
  // Whether a step that threw has left all that state() saves as it was before the step.
  bool untouched() const { return untouched_; }
  // Waits.
  StepFigures figures(Queue& queue);
  // Those of them that are counts of Gaussians and rows, and need no image. Waits.
  StepFigures counts(Queue& queue);
  // A sentence for the user about something that happened since the last call, or "".
  std::string take_notice();

  // All that a later step depends on beside configuration, scene and step number. Waits.
  Arrays state(Queue& queue);
  // Goes on from there, whatever the model was. Error when the arrays are not those of such a
  // model; `path`: the file they come from, for messages.
  void set_state(Queue& queue, const Arrays& arrays, const std::string& path);

  // What all learning rates are multiplied by; part of the state.
  float caution() const { return rates_.caution; }
  void set_caution(float caution) { rates_.caution = caution; }

  // Bands of spherical harmonics in use at a step.
  int sh_degree(int step) const;
  // Which time steps a training step is about.
  Stage stage(int step) const { return sampler_.stage(step); }
  // As after the last view of the last step.
  const Renderer& renderer() const { return renderer_; }
  const ImageGradients& image_gradients() const { return v_; }  // v_flow is stale without flow
  // Of the true picture on the device, in all its pixels.
  size_t picture_bytes() const { return truth_.size() + sizeof(float) * truth_floats_.size(); }

 private:
  struct FlowFigures {
    bool known = false;  // a tile was asked
    float loss = 0, epe = 0;
  };
  // Of the last view with flow; unknown before there was one. Waits.
  FlowFigures flow_figures(Queue& queue);
  // Has pictures and flow of the next steps loaded in the background, flow that must be computed
  // for several of them.
  void prefetch(int step);
  // Behind pictures with alpha, sRGB.
  std::array<uint8_t, 3> background(int step) const;
  void train_view(Queue& queue, const Sample& sample, int step, int in_batch);
  // The image loss of what was drawn, by picture_part_, and its gradient.
  void compare_with_picture(Queue& queue, int width, int height, float share);
  // Uploads a sample's flow and its confidence. How much the flow loss weighs for it.
  float upload_teacher(Queue& queue, const Sample& sample, int width);
  // Asks for guidance and adds its gradients.
  void guide(Queue& queue, int step);
  void renew_neighbours_if_due(Queue& queue, int step);
  void update(Queue& queue, int step);

  Queue& queue_;
  const TrainConfig& config_;
  const Scene& scene_;
  FrameStore& frames_;
  const std::vector<FlowPair>& pairs_;
  FlowStore& flows_;
  Sampler sampler_;
  Model& model_;
  Rates rates_;
  Renderer renderer_;
  ImageLoss image_loss_;
  FlowLoss flow_loss_;
  std::unique_ptr<FlowTiles> flow_tiles_;    // nullptr: all tiles always count
  std::unique_ptr<MotionLoss> motion_loss_;  // nullptr: all its weights are 0
  Adam adam_;                                // of the Gaussians' table
  std::unique_ptr<Adam> path_adam_;          // of the others, if there are
  Population population_;
  std::unique_ptr<Guide> guide_;  // nullptr: no guidance
  Reduce reduce_;
  Buffer<cl_uchar> truth_{"truth"}, confidence_{"confidence"};
  Buffer<float> truth_floats_{"truth as floats"}, teacher_{"teacher flow"};
  ImageGradients v_;
  // what asynchronous writes read from
  std::vector<cl_uchar> picture_part_, confidence_part_;
  std::vector<float> flow_planes_, picture_floats_;
  bool had_flow_ = false, had_motion_loss_ = false;  // the last view
  bool flow_is_new_ = false;                         // and flow_figures_ of an earlier one
  FlowFigures flow_figures_;
  bool neighbours_known_ = false;
  bool untouched_ = true;   // by the step under way
  int empty_pictures_ = 0;  // in a row, up to now
  bool emptiness_told_ = false;
};

}  // namespace gflow
