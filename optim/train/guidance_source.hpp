// SPDX-License-Identifier: Apache-2.0
// The guidance that the settings ask for.
#pragma once
#include <memory>

#include "optim/guidance/guidance.hpp"
#include "optim/train/config.hpp"

namespace gflow {

// Starts the program, reads the network or finds the pictures; nullptr when there is to be no
// guidance. Error that names the setting when something is missing or does not fit.
std::unique_ptr<Guidance> guidance_of(const TrainConfig& config);

// Error when guidance.cameras names a split without views.
void require_guided_views(const TrainConfig& config, const Scene& scene);

}  // namespace gflow
