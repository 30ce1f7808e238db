// SPDX-License-Identifier: Apache-2.0
// Messages before the first step: what was found, the initial Gaussians, and settings without
// effect.
#pragma once
#include <string>
#include <vector>

#include "optim/model/model.hpp"
#include "optim/options/train_options.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

// One line: layout, cameras, time steps and images; another line if the test views are training
// views. cameras: the scene's, at training size.
std::string in_words(const Scene& scene, const std::vector<Camera>& cameras);

// One line: number and origin of the initial Gaussians, and how many are short-lived. model: from
// initial_model with these settings. place_of_points:
// Preparation::place_of_points.
std::string first_gaussians_in_words(const HostModel& model, const Scene& scene,
                                     const InitOptions& init, const char* place_of_points);

// One line if more steps would be worth their time, because the images of a large scene are each
// used few times; else empty.
std::string steps_in_words(const Scene& scene, const ScheduleOptions& schedule);

// One line if training cameras get colours of their own; else empty.
std::string colors_in_words(const Scene& scene, const TrainOptions& config);

// Warns of settings that the scene or another setting makes ineffective.
void warn_of_idle_settings(const Scene& scene, const TrainOptions& config);

}  // namespace gflow
