// SPDX-License-Identifier: Apache-2.0
// Creates the guidance provider of the settings.
#pragma once
#include <memory>
#include <string>

#include "optim/guidance/guidance.hpp"
#include "optim/options/train_options.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// Starts the program, reads the network or finds the images; nullptr if guidance is off. Error that
// names the setting if something is missing or does not fit.
std::unique_ptr<Guidance> guidance_of(const TrainOptions& config);

// Error if training with these settings would start a program. For callers that get the command
// from a file which somebody else may have written (run, checkpoint, settings); `where` names it.
void require_no_program(const TrainOptions& config, const std::string& where);

// Error if guidance.cameras names a split without views.
void require_guided_views(const TrainOptions& config, const Scene& scene);

}  // namespace gflow
