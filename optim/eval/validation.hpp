// SPDX-License-Identifier: Apache-2.0
// PSNR of views that training does not see, beside that of views that it sees, while it goes on:
// the gap between the two is what the model invents.
#pragma once
#include <string>
#include <vector>

#include "optim/model/renderer.hpp"
#include "optim/options/train_options.hpp"
#include "optim/scene/loaded_scene.hpp"

namespace gflow {

// Means over some views [dB], with matched colours (color_matched in metrics.hpp), because nobody
// knows the exposure of a camera that is not trained.
struct ValidationPsnr {
  double val = 0, train = 0;
};

class Validation {
 public:
  // Takes up to eight views of scene.val and as many of scene.train, evenly. All references must
  // outlive it.
  Validation(Queue& queue, const TrainOptions& config, const LoadedScene& loaded);

  // Whether there are views to validate with.
  bool possible() const { return !val_.empty(); }
  // Renders the views. Waits.
  ValidationPsnr measure(Queue& queue, Model& model);
  // A sentence, each once, if the PSNR of the validation views has fallen well below its best while
  // that of the training views grew, or if the gap between the two has opened; else "". `steps`
  // have been made.
  std::string warning(const ValidationPsnr& now, int steps);

 private:
  double mean_psnr(Queue& queue, Model& model, const std::vector<Frame>& frames);

  const TrainOptions& config_;
  const LoadedScene& loaded_;
  std::vector<Frame> val_, train_;
  Renderer renderer_;
  ValidationPsnr best_;  // when val was highest
  int best_steps_ = 0;
  double first_gap_ = 0;  // of the first measurement [dB]
  bool warned_of_worse_ = false, warned_of_gap_ = false;
};

}  // namespace gflow
