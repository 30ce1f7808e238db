// SPDX-License-Identifier: Apache-2.0
// The guidance that the settings ask for.
#pragma once
#include <memory>
#include <string>

#include "optim/guidance/guidance.hpp"
#include "optim/options/train_options.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// Starts the program, reads the network or finds the pictures; nullptr when there is to be no
// guidance. Error that names the setting when something is missing or does not fit.
std::unique_ptr<Guidance> guidance_of(const TrainOptions& config);

// Error when training with these settings would start a program. For those whose command comes from
// a file, which may be somebody else's: a run, a checkpoint, settings; `where` names it.
void require_no_program(const TrainOptions& config, const std::string& where);

// Error when guidance.cameras names a split without views.
void require_guided_views(const TrainOptions& config, const Scene& scene);

}  // namespace gflow
