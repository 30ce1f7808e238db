// SPDX-License-Identifier: Apache-2.0
// What the choices about the image are worth in a training: not in as many steps, but in as much
// time.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "apps/bench/choices.hpp"
#include "apps/bench/samples.hpp"
#include "apps/common/options.hpp"

namespace gflow::bench {

struct TrainingOptions {
  std::string scene;                  // folder or video; empty: nothing is trained
  std::vector<std::string> settings;  // of all trainings, "section.key=value"
  int steps = 3000;                   // with the settings as shipped
  int seeds = 3;                      // from 0
};

// Of one choice. PSNR, that where things move [dB] and the error of the flow there [px] of the test
// views, a sample for each seed; NaN where the scene has nothing to measure it by.
struct TrainedChoice {
  Choice choice;
  Spread of_shipped;  // CPU time of a step
  int steps = 0;      // that fit into the time
  Samples psnr, psnr_dynamic, flow_epe_dynamic;
};

// Before anything is measured. Error when there is no such scene, or a setting is one that the
// choices differ by.
void require_trainable(const TrainingOptions& o);

// First the time of a step with each choice, from the middle of one of --steps, at least `repeats`
// blocks of it in turn with the shipped one; then the trainings, of so many steps as that time
// leaves. So who disturbs the machine during the long trainings changes nothing. Error when the
// scene cannot be trained; Interrupted on Ctrl-C.
std::vector<TrainedChoice> train_choices(Queue& queue, const std::vector<Choice>& choices,
                                         const TrainingOptions& o, int repeats,
                                         const GlobalOptions& options);

}  // namespace gflow::bench
