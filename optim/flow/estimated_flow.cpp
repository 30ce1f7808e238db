// SPDX-License-Identifier: Apache-2.0
#include "optim/flow/estimated_flow.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <filesystem>
#include <memory>
#include <set>
#include <utility>

#include "runtime/base/error.hpp"
#include "runtime/base/parallel.hpp"

namespace gflow {
namespace {

// Background of images with alpha: differs from dark and bright objects, so that both keep their
// outlines. Black gives better flow for dark objects and worse for bright ones, white for neither.
constexpr std::array<uint8_t, 3> mid_grey = {128, 128, 128};

// Cache of unpacked flows. Training requests flows in shuffled order and prefetches them, so a
// larger cache would not be hit more often for a large scene, and a small scene fits.
constexpr size_t memory_bytes = size_t{1} << 28;

std::pair<TargetFlow, TargetFlow> flows_between(FrameStore& frames, const Frame& from,
                                                const Frame& to) {
  return estimate_target_flows(frames.rgb_over(from, mid_grey), frames.rgb_over(to, mid_grey),
                               camera_motion(from, to));
}

FlowPair reverse(const FlowPair& pair) { return {pair.next, pair.frame, pair.span}; }

// The pairs with two frames, each once, as {earlier, later} index.
std::vector<FlowPair> without_direction(const std::vector<FlowPair>& pairs) {
  std::map<std::pair<int, int>, int> spans;
  for (const FlowPair& pair : pairs)
    if (pair.next >= 0) spans[std::minmax(pair.frame, pair.next)] = pair.span;
  std::vector<FlowPair> once;
  for (const auto& [frames, span] : spans) once.push_back({frames.first, frames.second, span});
  return once;
}

std::string name_in_folder(const Scene& scene, const FlowPair& pair) {
  return scene.train[size_t(pair.frame)].name + (is_backward_in_time(scene, pair) ? "_back" : "") +
         (pair.span > 1 ? fmt::format("_over_{}", pair.span) : "");
}

class Estimator {
 public:
  Estimator(const Scene& scene, FrameStore& frames, const FlowEstimation& how)
      : scene_(scene),
        frames_(frames),
        folder_(how.folder, how.budget, how.notice),
        notice_(how.notice) {}

  // Ensures that both directions are on disk. Error if they cannot be written.
  void prepare(const FlowPair& pair) {
    if (has(pair) && has(reverse(pair))) return;
    const auto [there, back] = compute(pair);
    folder_.keep(name(pair), there);
    folder_.keep(name(reverse(pair)), back);
  }

  TargetFlow flow(const FlowPair& pair) {
    const Turn turn(*this, pair);
    const Camera& camera = camera_of(pair);
    if (auto kept = folder_.read(name(pair), camera.width, camera.height)) return *std::move(kept);
    const auto [there, back] = compute(pair);
    try_keep({{name(pair), &there}, {name(reverse(pair)), &back}});
    return unpacked(there, name(pair));
  }

  TargetFlow made(const FlowPair& pair, const MakeFlow& make) {
    const std::string kept_as = name(pair) + "_chained";
    const Camera& camera = camera_of(pair);
    if (auto kept = folder_.read(kept_as, camera.width, camera.height)) return *std::move(kept);
    const Bytes bytes = packed(make());
    try_keep({{kept_as, &bytes}});
    return unpacked(bytes, kept_as);
  }

  // Error if the missing flows will not fit on the disk: better at the start than after hours.
  void require_room(const std::vector<FlowPair>& work) const {
    double bytes = 0;
    for (const FlowPair& pair : work)
      for (const FlowPair& way : {pair, reverse(pair)})
        if (!has(way)) bytes += likely_bytes(camera_of(way));
    require_free_space(folder_.path(), uint64_t(bytes),
                       fmt::format("optical flow of {} image pairs", work.size()),
                       "reduce flow.store [GiB] to compute flow on demand, use smaller images "
                       "(-r 2) or fewer of them (scene.stride, scene.max_steps), disable flow "
                       "(flow.enabled = false), or write to another disk");
  }

  static double likely_bytes(const Camera& camera) {
    return packed_flow_bytes_per_pixel * camera.width * camera.height;
  }

 private:
  // Held while the flow between two frames is computed, in either direction. A thread that waited
  // finds the flow in the folder.
  class Turn {
   public:
    Turn(Estimator& owner, const FlowPair& pair)
        : owner_(owner), frames_(std::minmax(pair.frame, pair.next)) {
      std::unique_lock<std::mutex> lock(owner_.mutex_);
      owner_.ended_.wait(lock, [&] { return !owner_.at_work_.count(frames_); });
      owner_.at_work_.insert(frames_);
    }
    Turn(const Turn&) = delete;
    Turn& operator=(const Turn&) = delete;
    ~Turn() {
      const std::lock_guard<std::mutex> lock(owner_.mutex_);
      owner_.at_work_.erase(frames_);
      owner_.ended_.notify_all();
    }

   private:
    Estimator& owner_;
    std::pair<int, int> frames_;
  };

  const Frame& frame(int i) const { return scene_.train[size_t(i)]; }
  const Camera& camera_of(const FlowPair& pair) const { return frames_.camera(frame(pair.frame)); }
  std::string name(const FlowPair& pair) const { return name_in_folder(scene_, pair); }
  bool has(const FlowPair& pair) const {
    return folder_.has(name(pair), camera_of(pair).width, camera_of(pair).height);
  }

  // Storing is optional: a full disk only causes a notice.
  void try_keep(const std::vector<std::pair<std::string, const Bytes*>>& flows) {
    try {
      for (const auto& [name, bytes] : flows) folder_.keep(name, *bytes);
    } catch (const Error& problem) {
      if (!was_full_.exchange(true) && notice_)
        notice_(fmt::format("optical flow cannot be stored and will be recomputed when needed: {}",
                            problem.what()));
    }
  }

  // The packed flows of a pair in both directions. The consistency check needs both, and the result
  // must not depend on which is requested.
  std::pair<Bytes, Bytes> compute(const FlowPair& pair) {
    const auto [there, back] = flows_between(frames_, frame(pair.frame), frame(pair.next));
    return {packed(there), packed(back)};
  }

  const Scene& scene_;
  FrameStore& frames_;
  FlowFolder folder_;
  Notice notice_;
  std::atomic<bool> was_full_{false};
  std::mutex mutex_;
  std::condition_variable ended_;
  std::set<std::pair<int, int>> at_work_;
};

}  // namespace

size_t num_compared(const std::vector<FlowPair>& pairs) { return without_direction(pairs).size(); }

uint64_t likely_flow_bytes(const Scene& scene, const std::vector<FlowPair>& pairs,
                           const FrameStore& frames) {
  double bytes = 0;
  for (const FlowPair& pair : without_direction(pairs))
    for (const int i : {pair.frame, pair.next})
      bytes += Estimator::likely_bytes(frames.camera(scene.train[size_t(i)]));
  return uint64_t(bytes);
}

StoreFlow stored_flows(const Scene& scene, FrameStore& frames, const FlowEstimation& how) {
  const auto keeper = std::make_shared<Estimator>(scene, frames, how);
  return [=](const FlowPair& pair, const MakeFlow& make) { return keeper->made(pair, make); };
}

FlowStore estimated_flows(const Scene& scene, const std::vector<FlowPair>& pairs,
                          FrameStore& frames, const FlowEstimation& how) {
  const size_t threads = how.threads > 0 ? size_t(how.threads) : num_cores();
  const auto estimator = std::make_shared<Estimator>(scene, frames, how);
  if (how.beforehand) {
    const std::vector<FlowPair> work = without_direction(pairs);
    estimator->require_room(work);
    std::mutex progress_mutex;
    size_t done = 0;
    for_each_parallel(work.size(), threads, [&](size_t i) {
      estimator->prepare(work[i]);
      const std::lock_guard<std::mutex> lock(progress_mutex);
      ++done;
      if (how.progress) how.progress(done, work.size());
    });
  }
  std::vector<FlowStore::Loader> loaders;
  for (const FlowPair& pair : pairs) {
    if (pair.next < 0)
      loaders.emplace_back();
    else
      loaders.emplace_back([=] { return estimator->flow(pair); });
  }
  FlowStoreOptions options;
  options.cache_bytes = memory_bytes;
  options.is_precomputed = how.beforehand;
  options.threads = how.beforehand ? 1 : threads;
  return FlowStore(std::move(loaders), options);
}

FlowBetween::FlowBetween(const Scene& scene, FrameStore& frames, const std::string& folder,
                         Notice notice)
    : frames_(frames) {
  if (!std::filesystem::is_directory(folder)) return;
  folder_.emplace(folder, 0, std::move(notice));
  for (const FlowPair& pair : neighbour_pairs(scene))
    if (pair.next >= 0)
      names_[{image_id(scene.train[size_t(pair.frame)]),
              image_id(scene.train[size_t(pair.next)])}] = name_in_folder(scene, pair);
}

std::optional<TargetFlow> FlowBetween::kept(const Frame& from, const Frame& to) const {
  const auto name = names_.find({image_id(from), image_id(to)});
  if (name == names_.end()) return std::nullopt;
  const Camera& camera = frames_.camera(from);
  return folder_->read(name->second, camera.width, camera.height);
}

TargetFlow FlowBetween::target_flow(const Frame& from, const Frame& to) const {
  if (auto flow = kept(from, to)) return *std::move(flow);
  return unpacked(packed(flows_between(frames_, from, to).first), from.name);
}

}  // namespace gflow
