// SPDX-License-Identifier: Apache-2.0
// The motion model by trial: short trainings that do not see some of the training views, and are
// judged by them.
#pragma once
#include <map>

#include "optim/options/train_options.hpp"
#include "runtime/cl/queue.hpp"

namespace gflow {

// Whether motion.model is chosen by trainings (motion.trial_steps).
bool chooses_by_trials(const TrainOptions& config);

// Trains on the scene of `config` with each of spacetime, keyframes, hexplane and nodes, without
// every eighth camera, or of a single camera without every eighth image, and returns the model
// whose mean PSNR of these is highest, the one that the kind of scene suggests (motion_model()) if
// it is within .3 dB. Prints each result unless quiet. Images of videos and optical flow
// go to a temporary folder. Error if the scene cannot be trained on.
MotionChoice model_by_trials(Queue& queue, const TrainOptions& config, bool quiet);

// The model with the highest PSNR [dB], but `suggested` unless another is .3 dB better.
MotionModelKind best_of_trials(const std::map<MotionModelKind, double>& psnr,
                               MotionModelKind suggested);

}  // namespace gflow
