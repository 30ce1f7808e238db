// SPDX-License-Identifier: Apache-2.0
// Optical flow of a scene's frame pairs, computed from the images and stored on disk, rounded as in
// packed_flow.hpp. The result is rounded whether it was stored or not.
#pragma once
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "optim/flow/flow_folder.hpp"
#include "optim/flow/flow_store.hpp"
#include "optim/flow/optical_flow.hpp"
#include "runtime/base/report.hpp"

namespace gflow {

struct FlowEstimation {
  std::string folder;                   // where flows are stored, see FlowFolder
  uint64_t budget = uint64_t{8} << 30;  // limit on all flows together [bytes]
  bool beforehand = true;               // compute all flows now; else each when it is requested
  int threads = 0;                      // number of computing threads; 0: all cores
  ProgressCallback progress;            // of computing beforehand, in frame pairs
  Notice notice;                        // for a damaged file or a full disk
};

// Number of frame pairs, counting both directions as one.
size_t num_compared(const std::vector<FlowPair>& pairs);

// Estimated size of all flows on disk [bytes].
uint64_t likely_flow_bytes(const Scene& scene, const std::vector<FlowPair>& pairs,
                           const FrameStore& frames);

// Two frames of one pose are those of a camera that stands still.
inline CameraMotion camera_motion(const Frame& a, const Frame& b) {
  return a.camera == b.camera ? CameraMotion::none : CameraMotion::any;
}

// DIS flow from one frame to a later one of its track, in any split: the flow that estimated_flows
// stored if training uses the same pair, else computed. Both give the same values. Stores nothing.
class FlowBetween {
 public:
  // folder: that of estimated_flows for the same images; it may be missing. `frames` must outlive
  // this.
  FlowBetween(const Scene& scene, FrameStore& frames, const std::string& folder, Notice notice);

  TargetFlow target_flow(const Frame& from, const Frame& to) const;

 private:
  std::optional<TargetFlow> kept(const Frame& from, const Frame& to) const;

  FrameStore& frames_;
  std::optional<FlowFolder> folder_;
  std::map<std::pair<ImageId, ImageId>, std::string> names_;  // of the stored flows
};

// A cache for flows derived from other flows. Reads the flow from the folder if it is there, else
// makes, rounds and stores it, under the name of the pair's computed flow with suffix _chained.
using MakeFlow = std::function<TargetFlow()>;
using StoreFlow = std::function<TargetFlow(const FlowPair& pair, const MakeFlow& make)>;
// `scene` and `frames` must outlive the result; uses folder, budget and notice of `how`.
StoreFlow stored_flows(const Scene& scene, FrameStore& frames, const FlowEstimation& how);

// DIS flow for every pair with next >= 0 at the resolution of `frames`. Stored under the name of
// its frame, with suffix _back if it leads back in time and _over_4 if it spans four frames. Error
// at the start if the disk has no room for the missing flows; a disk that fills up later only means
// that flows are recomputed. `scene` and `frames` must outlive the store.
FlowStore estimated_flows(const Scene& scene, const std::vector<FlowPair>& pairs,
                          FrameStore& frames, const FlowEstimation& how);

}  // namespace gflow
