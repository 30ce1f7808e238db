// SPDX-License-Identifier: Apache-2.0
// What a training tells its user before the first step: what it found, what it begins with, and
// which settings do nothing.
#pragma once
#include <string>
#include <vector>

#include "optim/model/model.hpp"
#include "optim/options/train_options.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// A line with layout, cameras, time steps and pictures; another one where the test views are those
// that are trained on. cameras: the scene's, in the size that is trained.
std::string in_words(const Scene& scene, const std::vector<Camera>& cameras);

// A line: how many there are, where they come from, and how many of them are short-lived. model: as
// initial_model made it with these settings. stereo: the scene's points are those that several
// cameras agree on.
std::string first_gaussians_in_words(const HostModel& model, const Scene& scene,
                                     const InitOptions& init, bool stereo);

// Warns of settings that the scene, or another setting, keeps from having the effect they are for.
void warn_of_idle_settings(const Scene& scene, const TrainOptions& config);

}  // namespace gflow
