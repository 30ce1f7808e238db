// SPDX-License-Identifier: Apache-2.0
// First Gaussians where things move. A point cloud of one moment says nothing about the others; but
// fixed cameras see at every step which pixels differ from their usual colour, and what several of
// them see changed at once is (the visual hull of) what moves. With optical flow each seed starts
// with the velocity that best explains the flow of all cameras; at rest where flow is computed only
// when training asks for it.
#pragma once
#include "optim/flow/flow_store.hpp"
#include "optim/init/motion_mask.hpp"
#include "optim/model/model.hpp"
#include "optim/options/train_options.hpp"

namespace gflow {

struct Seeds {
  std::vector<float> xyz;       // [n, 3] world
  std::vector<uint8_t> rgb;     // [n, 3]
  std::vector<float> velocity;  // [n, 3] world per length of the video; 0 where unknown
  std::vector<float> time;      // [n] in [0, 1]
  std::vector<float> spacing;   // [n] mean distance to neighbours of the same step
  size_t size() const { return time.size(); }
};

// About config.init.dynamic seeds, spread evenly over the steps; none where fewer than three fixed
// cameras see a step, or nothing changes. flows[i] belongs to pairs[i]; both may be empty.
// Candidates are random in the box around the scene's points. Deterministic for config.train.seed.
Seeds dynamic_seeds(const Scene& scene, FrameStore& frames,
                    const std::vector<StaticCamera>& static_cameras,
                    const std::vector<FlowPair>& pairs, FlowStore& flows,
                    const TrainOptions& config);

}  // namespace gflow
