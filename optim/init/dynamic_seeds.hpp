// SPDX-License-Identifier: Apache-2.0
// Initial Gaussians for moving objects, which a point cloud of one time misses. Static cameras show
// at every time step which pixels differ from their median colour; the visual hull of these pixels
// contains what moves. With precomputed optical flow each seed starts with the velocity that best
// explains the flow of all cameras; otherwise with velocity 0.
#pragma once
#include "optim/flow/flow_store.hpp"
#include "optim/init/motion_mask.hpp"
#include "optim/model/model.hpp"
#include "optim/options/train_options.hpp"

namespace gflow {

struct Seeds {
  std::vector<float> xyz;       // [n, 3] world
  std::vector<uint8_t> rgb;     // [n, 3]
  std::vector<float> velocity;  // [n, 3] world units per length of the video; 0 if unknown
  std::vector<float> time;      // [n] in [0, 1]
  std::vector<float> spacing;   // [n] mean distance to neighbours of the same time step
  size_t size() const { return time.size(); }
};

// About config.init.dynamic seeds, evenly distributed over the time steps; none if fewer than three
// static cameras show a time step, or nothing changes. flows[i] belongs to pairs[i]; both may be
// empty. Candidates are random in the box of the scene's points, or where rays of change meet if
// that finds more. Deterministic for config.train.seed.
Seeds dynamic_seeds(const Scene& scene, FrameStore& frames,
                    const std::vector<StaticCamera>& static_cameras,
                    const std::vector<FlowPair>& pairs, FlowStore& flows,
                    const TrainOptions& config);

}  // namespace gflow
