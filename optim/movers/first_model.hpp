// SPDX-License-Identifier: Apache-2.0
// The initial model of a scene that one moving camera films: first what rests, then what moves.
#pragma once
#include <optional>

#include "optim/movers/motion_masks.hpp"
#include "optim/movers/paths.hpp"

namespace gflow {

struct MovingScene {
  HostModel model;  // Gaussians of what moves first; the others are static
  MotionMasks masks;
};

// Called when a stage of the work begins; returns what receives its progress.
using BeginStage = std::function<ProgressCallback(const char* name, size_t total)>;

// The model; nullopt if hardly anything is at rest for these cameras, so that there is no place to
// begin.
// 1. Pixels whose flow no point at rest explains are suspects (suspects.hpp).
// 2. A static model is trained on all others; what differs from it moves (background.hpp).
// 3. What moves is linked over time and gets a depth (movers.hpp), and its pixels paths
// (paths.hpp).
// 4. Gaussians on these paths join those of the static model, and the motion model learns to follow
//    them (follow_paths.hpp).
std::optional<MovingScene> moving_scene(Queue& queue, const Scene& scene, FrameStore& store,
                                        const TrainOptions& options, const TrainModel& train,
                                        const BeginStage& begin);

}  // namespace gflow
