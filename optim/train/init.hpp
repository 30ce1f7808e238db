// SPDX-License-Identifier: Apache-2.0
// The first Gaussians: at the scene's points, or random ones where it has none. They stand still and
// last for the whole video; training makes them move and gives them shorter lives.
#pragma once
#include "optim/data/frame_store.hpp"
#include "optim/train/config.hpp"
#include "optim/train/model.hpp"

namespace gflow {

// Random points fill a box around the place the cameras look at; where pictures have alpha, only
// points that most cameras see as part of the object are kept. Deterministic for config.train.seed.
// Error when points are asked for and the scene has none.
HostModel initial_model(const Scene& scene, FrameStore& frames, const TrainConfig& config);

// Mean distance to the three nearest other points, for each of xyz [n, 3]; never 0.
std::vector<float> neighbour_distance(const std::vector<float>& xyz);

}  // namespace gflow
