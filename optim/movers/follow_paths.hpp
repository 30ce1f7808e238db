// SPDX-License-Identifier: Apache-2.0
// Gives the first Gaussians of a model the motion of paths.
#pragma once
#include "optim/movers/paths.hpp"

namespace gflow {

// Gaussian i follows path i: the field of nodes and hexplane is trained on them; other models take
// the velocity of each path where it was chosen. Reports progress in steps.
constexpr size_t kStepsOnPaths = 3000;
void follow_paths(Queue& queue, HostModel& model, const Paths& paths, const Scene& scene,
                  const TrainOptions& options, const ProgressCallback& progress = {});

}  // namespace gflow
