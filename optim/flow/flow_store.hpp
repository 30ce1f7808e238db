// SPDX-License-Identifier: Apache-2.0
// Flows of a scene's frame pairs on demand: the scene's true flow, files of the user's, or computed
// ones (estimated_flow.hpp); loaded when asked for, or by background threads ahead of time, and
// kept within a memory bound.
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
  size_t cache_bytes = size_t{1} << 30;  // flows kept in memory; oldest go first
  bool at_hand = true;                   // each flow takes no longer than reading a file
  size_t threads = 1;                    // that load what prefetch() asks for
};

// Flow i belongs to pair i of the list it was made for. Thread-safe.
class FlowStore {
 public:
  using Loader = std::function<TeacherFlow()>;
  explicit FlowStore(std::vector<Loader> loaders, const FlowStoreOptions& options = {});
  ~FlowStore();
  FlowStore(FlowStore&&) noexcept;
  FlowStore& operator=(FlowStore&&) noexcept;

  size_t size() const;
  // False where nothing gives a flow for the pair, e.g. an estimate for a pair without next frame.
  bool has(size_t pair) const;
  // Flow and confidence at the frame store's resolution. Error when it cannot be read.
  std::shared_ptr<const TeacherFlow> get(size_t pair);

  // Asks background threads to load these, in order, instead of what they have not begun yet.
  // Pairs that fail are left for get() to report.
  void prefetch(const std::vector<size_t>& pairs);
  // How many pairs are worth asking for at a time: enough for all threads.
  size_t worth_prefetching() const;
  // False where flows are computed when they are asked for: who wants many must do without.
  bool at_hand() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// The scene's own true flow where a frame has it; confidence where the mask is 255. None for pairs
// that lead back in time or to another pose: a true flow is that seen by a camera at rest.
FlowStore true_flows(const Scene& scene, const std::vector<FlowPair>& pairs,
                     const FrameStore& frames);

// Flow made elsewhere: FOLDER/<camera name>/<step, 4 digits>.{flo,flo.gz,png,npy} (png: KITTI;
// npy: [H,W,2]) or FOLDER/<picture's name>.{...}; confidence 255 where valid, or where the
// ..._mask.png beside it is > 127.
// Error when a pair's file is missing, naming what was tried; none for pairs that lead back in
// time. It leads from picture to picture: where a frame has a pair with a next frame, the other has
// none.
FlowStore flows_from_folder(const Scene& scene, const std::vector<FlowPair>& pairs,
                            const FrameStore& frames, const std::string& folder);

// A store of the pairs of `first`, then of those that `more` loads.
FlowStore extended(std::shared_ptr<FlowStore> first, std::vector<FlowStore::Loader> more);

// True flow of any frame (e.g. a test view) at width x height; Error when it has none.
TeacherFlow read_true_flow(const Frame& frame, int width, int height);

}  // namespace gflow
