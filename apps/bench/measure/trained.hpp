// SPDX-License-Identifier: Apache-2.0
// Effect of the choices about the image on training quality: for equal time, not for equal steps.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "apps/bench/measure/choices.hpp"
#include "apps/bench/measure/samples.hpp"
#include "apps/common/options.hpp"

namespace gflow::bench {

struct TrainingOptions {
  std::string scene;                  // folder or video; empty: no training
  std::vector<std::string> settings;  // of all trainings, "section.key=value"
  int steps = 3000;                   // with the default settings
  int seeds = 3;                      // from 0
};

// Results of one choice. PSNR, PSNR of moving parts [dB] and flow error of moving parts [px] of the
// test views, one sample per seed; NaN if the scene has no such ground truth.
struct TrainedChoice {
  Choice choice;
  Spread of_shipped;  // CPU time per step
  int steps = 0;      // that fit into the time
  Samples psnr, psnr_dynamic, flow_epe_dynamic;
};

// Call before anything is measured. Error if the scene does not exist, or a setting is one that the
// choices change.
void require_trainable(const TrainingOptions& o);

// First measures the time per step of each choice, from the middle of a training of --steps, in at
// least `repeats` blocks alternating with the default choice. Then trains with the number of steps
// that fit into the same time, so that disturbances during the long trainings do not matter. Error
// if the scene cannot be trained; Interrupted on Ctrl-C.
std::vector<TrainedChoice> train_choices(Queue& queue, const std::vector<Choice>& choices,
                                         const TrainingOptions& o, int repeats,
                                         const GlobalOptions& options);

}  // namespace gflow::bench
