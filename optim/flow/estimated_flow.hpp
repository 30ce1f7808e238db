// SPDX-License-Identifier: Apache-2.0
// Flows of a scene's frame pairs computed from the pictures and kept on disk, rounded as
// packed_flow.hpp says. Whoever asks gets the rounded flow, whether it was there or not.
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
#include "runtime/base/report.hpp"

namespace gflow {

struct FlowEstimation {
  std::string folder;                   // where flows are kept, see FlowFolder
  uint64_t budget = uint64_t{8} << 30;  // of them all [bytes]
  bool beforehand = true;               // compute all now; else each when it is asked for
  int threads = 0;                      // that compute; 0: all cores
  ProgressCallback progress;            // while computing beforehand, in pairs of pictures
  Notice notice;                        // of a damaged file, or a full disk
};

// Pairs of pictures that are compared, each once for both ways.
size_t num_compared(const std::vector<FlowPair>& pairs);

// What all flows will likely take on the disk [bytes].
uint64_t likely_flow_bytes(const Scene& scene, const std::vector<FlowPair>& pairs,
                           const FrameStore& frames);

// DIS flow from one picture of a scene to a later one of its track, in any split: that which
// estimated_flows keeps in a folder where training compares the same two, else computed anew.
// Either gives the same values. Keeps nothing itself.
class FlowBetween {
 public:
  // folder: as above, of the same pictures; it need not be there. `frames` must outlive this.
  FlowBetween(const Scene& scene, FrameStore& frames, const std::string& folder, Notice notice);

  TeacherFlow teacher(const Frame& from, const Frame& to) const;
  // Without confidence, which takes half as long where it is computed.
  FlowField vectors(const Frame& from, const Frame& to) const;

 private:
  std::optional<TeacherFlow> kept(const Frame& from, const Frame& to) const;

  FrameStore& frames_;
  std::optional<FlowFolder> folder_;
  std::map<std::pair<PictureId, PictureId>, std::string> names_;  // of the flow between pictures
};

// Flow made of others, once: read from the folder where it is there, else made, rounded as it is
// kept, and kept. Under the name of the pair's computed flow and _chained.
using MakeFlow = std::function<TeacherFlow()>;
using KeepFlow = std::function<TeacherFlow(const FlowPair& pair, const MakeFlow& make)>;
// `scene` and `frames` must outlive it; how.folder, budget and notice count.
KeepFlow kept_flows(const Scene& scene, FrameStore& frames, const FlowEstimation& how);

// DIS flow for every pair with next >= 0 at the resolution of `frames`, kept under the name of its
// frame, NAME_back where it leads back in time, NAME_over_4 where it leads to the fourth picture
// after it. Error beforehand when the disk has no room for what is not there yet; a disk that fills
// up later only has flows computed again. `scene` and `frames` must outlive the store.
FlowStore estimated_flows(const Scene& scene, const std::vector<FlowPair>& pairs,
                          FrameStore& frames, const FlowEstimation& how);

}  // namespace gflow
