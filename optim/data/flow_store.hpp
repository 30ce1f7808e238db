// SPDX-License-Identifier: Apache-2.0
// Flows of a scene's frame pairs on demand: estimated ones kept on disk, the scene's true flow, or
// files of the user's; loaded when asked for and kept within a memory bound.
#pragma once
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "optim/data/frame_store.hpp"
#include "optim/data/optical_flow.hpp"
#include "optim/data/scene.hpp"

namespace gflow {

// Flow i belongs to pair i of the list it was made for. Thread-safe.
class FlowStore {
 public:
  using Loader = std::function<TeacherFlow()>;
  explicit FlowStore(std::vector<Loader> loaders, size_t cache_bytes = size_t{1} << 30);
  ~FlowStore();
  FlowStore(FlowStore&&) noexcept;
  FlowStore& operator=(FlowStore&&) noexcept;

  size_t size() const;
  // False where nothing gives a flow for the pair, e.g. an estimate for a pair without next frame.
  bool has(size_t pair) const;
  // Flow and confidence at the frame store's resolution. Error when it cannot be read.
  std::shared_ptr<const TeacherFlow> get(size_t pair);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// How far a longer work is. Called by worker threads, one at a time; an exception ends the work.
using ProgressCallback = std::function<void(size_t done, size_t total)>;

// DIS flow for every pair with next >= 0 at the resolution of `frames`, computed by `threads`
// workers (0: all cores) and kept in folder `cache` (made when missing) as NAME.flo and
// NAME_mask.png, NAME_back.flo and NAME_back_mask.png where it leads back in time; what is there in
// the right size is not computed again.
FlowStore estimated_flows(const Scene& scene, const std::vector<FlowPair>& pairs,
                          FrameStore& frames, const std::string& cache, int threads = 0,
                          const ProgressCallback& progress = {});

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

// True flow of any frame (e.g. a test view) at width x height; Error when it has none.
TeacherFlow read_true_flow(const Frame& frame, int width, int height);

}  // namespace gflow
