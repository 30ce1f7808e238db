// SPDX-License-Identifier: Apache-2.0
// Flows of a scene's frame pairs on demand: the scene's true flow, flow files of the user, or
// computed flow (estimated_flow.hpp). Loaded on request or prefetched by background threads, and
// cached within a memory bound.
#pragma once
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "optim/flow/optical_flow.hpp"
#include "optim/scene/frame_store.hpp"
#include "optim/scene/scene.hpp"

namespace gflow {

struct FlowStoreOptions {
  size_t cache_bytes = size_t{1} << 30;  // flows kept in memory; least recently used evicted first
  bool is_precomputed = true;            // loading a flow takes no longer than reading a file
  size_t threads = 1;                    // number of prefetching threads
};

// Flow i belongs to pair i of the list that the store was made for. Thread-safe.
class FlowStore {
 public:
  using Loader = std::function<TargetFlow()>;
  explicit FlowStore(std::vector<Loader> loaders, const FlowStoreOptions& options = {});
  ~FlowStore();
  FlowStore(FlowStore&&) noexcept;
  FlowStore& operator=(FlowStore&&) noexcept;

  size_t size() const;
  // False if the pair has no flow, e.g. an estimate for a pair without a next frame.
  bool has(size_t pair) const;
  // Flow and confidence at the resolution of the frame store. Error if it cannot be read.
  std::shared_ptr<const TargetFlow> get(size_t pair);

  // Queues pairs for the background threads, in order; replaces pairs queued before but not
  // started. Failures are reported by get().
  void prefetch(const std::vector<size_t>& pairs);
  // Number of pairs to prefetch at a time to keep all threads busy.
  size_t prefetch_count() const;
  // False if flows are computed on request, which makes many flows expensive.
  bool is_precomputed() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// The scene's own true flow; confidence 255 where valid and, if there is a mask, where it is 255.
// No flow for pairs that lead back in time or to another pose: true flow assumes a static camera.
FlowStore true_flows(const Scene& scene, const std::vector<FlowPair>& pairs,
                     const FrameStore& frames);

// Flow from files of the user: FOLDER/<camera name>/<step, 4 digits>.{flo,flo.gz,png,npy} (png:
// KITTI; npy: [H,W,2]) or FOLDER/<image name>.{...}. Confidence is 255 where the flow is valid and,
// if there is a ..._mask.png, where it is > 127. Error that lists the paths tried if a pair's file
// is missing. No flow for pairs that lead back in time, nor for pairs without a next frame if the
// same frame has one in another pair: the files lead from image to image.
FlowStore flows_from_folder(const Scene& scene, const std::vector<FlowPair>& pairs,
                            const FrameStore& frames, const std::string& folder);

// A store of the pairs of `first` followed by those of the loaders `more`.
FlowStore extended(std::shared_ptr<FlowStore> first, std::vector<FlowStore::Loader> more);

// True flow of any frame (e.g. a test view) at width x height. Error if it has none.
TargetFlow read_true_flow(const Frame& frame, int width, int height);

}  // namespace gflow
