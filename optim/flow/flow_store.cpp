// SPDX-License-Identifier: Apache-2.0
// Flows on demand.
#include "optim/flow/flow_store.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <filesystem>
#include <mutex>
#include <set>
#include <system_error>
#include <thread>

#include "optim/formats/npy.hpp"
#include "optim/images/lru_cache.hpp"
#include "optim/scene/readers/reader_util.hpp"
#include "runtime/base/error.hpp"
#include "runtime/files/file_name.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

std::vector<uint8_t> where_valid(const FlowField& flow) {
  std::vector<uint8_t> confidence(flow.valid.size());
  for (size_t i = 0; i < confidence.size(); ++i) confidence[i] = flow.valid[i] ? 255 : 0;
  return confidence;
}

// Confidence from a mask of the flow's size: 255 where the mask is at least `threshold`.
std::vector<uint8_t> read_mask(const std::string& path, const FlowField& flow, int threshold) {
  const Image mask = read_grey(path);
  if (mask.width != flow.width || mask.height != flow.height)
    throw Error(fmt::format("mask {} is {}x{}, but its flow is {}x{}", path, mask.width,
                            mask.height, flow.width, flow.height));
  std::vector<uint8_t> confidence = where_valid(flow);
  for (size_t i = 0; i < confidence.size(); ++i)
    if (mask.pixels[i] < threshold) confidence[i] = 0;
  return confidence;
}

// Resizes a flow to the frame's resolution. Error if its aspect ratio differs from the camera's.
TargetFlow fitted(const TargetFlow& target_flow, int width, int height, const std::string& path) {
  const double sx = double(width) / target_flow.flow.width,
               sy = double(height) / target_flow.flow.height;
  if (!(sx / sy > 0.98 && sx / sy < 1.02))
    throw Error(fmt::format("flow {} is {}x{}, but its image is {}x{}: the aspect ratios differ",
                            path, target_flow.flow.width, target_flow.flow.height, width, height));
  return resized(target_flow, width, height);
}

FlowField flow_from_npy(const std::string& path) {
  const Array array = read_npy(path);
  const auto& shape = array.shape;
  if (shape.size() != 3 || shape[2] != 2 || shape[0] < 1 || shape[1] < 1 || shape[0] > 32768 ||
      shape[1] > 32768)
    throw Error(
        fmt::format("flow {} has shape {}, expected (height, width, 2)", path, array.shape_text()));
  FlowField flow = zero_flow(int(shape[1]), int(shape[0]));
  flow.uv = array.as_float();
  for (size_t i = 0; i < flow.valid.size(); ++i) {
    flow.valid[i] = std::fabs(flow.uv[2 * i]) <= 1e9f && std::fabs(flow.uv[2 * i + 1]) <= 1e9f;
    if (!flow.valid[i]) flow.uv[2 * i] = flow.uv[2 * i + 1] = 0;
  }
  return flow;
}

FlowField read_any_flow(const std::string& path) {
  const std::string extension = fs::path(path).extension().string();
  if (extension == ".png") return read_kitti_flow(path);
  if (extension == ".npy") return flow_from_npy(path);
  return read_flo(path);
}

}  // namespace

struct FlowStore::State {
  std::vector<Loader> loaders;
  FlowStoreOptions options;
  LruCache<size_t, TargetFlow> cache;

  std::vector<std::thread> workers;
  std::mutex mutex;
  std::condition_variable changed;
  std::deque<size_t> queue;
  std::set<size_t> at_work;
  bool stopping = false;

  State(std::vector<Loader> l, const FlowStoreOptions& o)
      : loaders(std::move(l)), options(o), cache(o.cache_bytes) {}

  ~State() {
    {
      const std::lock_guard<std::mutex> lock(mutex);
      stopping = true;
    }
    changed.notify_all();
    for (std::thread& worker : workers) worker.join();
  }

  std::shared_ptr<const TargetFlow> get(size_t pair) {
    return cache.get(pair, loaders[pair], [](const TargetFlow& target_flow) {
      return target_flow.flow.uv.size() * sizeof(float) + 2 * target_flow.confidence.size();
    });
  }

  // Loads the first queued pair that no other worker is loading.
  void run_prefetch() {
    std::unique_lock<std::mutex> lock(mutex);
    for (;;) {
      const auto is_free = [&](size_t pair) { return !at_work.count(pair); };
      auto found = queue.end();
      changed.wait(lock, [&] {
        found = std::find_if(queue.begin(), queue.end(), is_free);
        return stopping || found != queue.end();
      });
      if (stopping) return;
      const size_t pair = *found;
      queue.erase(found);
      at_work.insert(pair);
      lock.unlock();
      try {
        get(pair);
      } catch (const std::exception&) {
        // FlowStore::get() will fail in the same way and report it.
      }
      lock.lock();
      at_work.erase(pair);
    }
  }
};

FlowStore::FlowStore(std::vector<Loader> loaders, const FlowStoreOptions& options)
    : state_(std::make_unique<State>(std::move(loaders), options)) {}
FlowStore::~FlowStore() = default;
FlowStore::FlowStore(FlowStore&&) noexcept = default;
FlowStore& FlowStore::operator=(FlowStore&&) noexcept = default;

size_t FlowStore::size() const { return state_->loaders.size(); }

bool FlowStore::has(size_t pair) const { return pair < size() && state_->loaders[pair]; }

std::shared_ptr<const TargetFlow> FlowStore::get(size_t pair) {
  if (!has(pair)) throw Error(fmt::format("there is no flow for frame pair {}", pair));
  return state_->get(pair);
}

void FlowStore::prefetch(const std::vector<size_t>& pairs) {
  const std::lock_guard<std::mutex> lock(state_->mutex);
  state_->queue.clear();
  for (const size_t pair : pairs)
    if (has(pair)) state_->queue.push_back(pair);
  if (state_->workers.empty() && !state_->queue.empty()) try {
      for (size_t t = 0; t < state_->options.threads; ++t)
        state_->workers.emplace_back([state = state_.get()] { state->run_prefetch(); });
    } catch (const std::system_error&) {  // out of threads: flows are loaded on request
    }
  state_->changed.notify_all();
}

size_t FlowStore::prefetch_count() const { return 2 * state_->options.threads; }

bool FlowStore::is_precomputed() const { return state_->options.is_precomputed; }

TargetFlow read_true_flow(const Frame& frame, int width, int height) {
  if (frame.flow_path.empty()) throw Error(fmt::format("frame {} has no true flow", frame.name));
  TargetFlow target_flow{read_any_flow(frame.flow_path), {}};
  target_flow.confidence = frame.flow_mask_path.empty()
                               ? where_valid(target_flow.flow)
                               : read_mask(frame.flow_mask_path, target_flow.flow, 255);
  return fitted(target_flow, width, height, frame.flow_path);
}

FlowStore extended(std::shared_ptr<FlowStore> first, std::vector<FlowStore::Loader> more) {
  FlowStoreOptions options;
  options.cache_bytes = size_t{1} << 28;  // in addition to the cache of `first`
  options.is_precomputed = first->is_precomputed();
  options.threads = first->prefetch_count() / 2;
  std::vector<FlowStore::Loader> loaders;
  for (size_t i = 0; i < first->size(); ++i)
    loaders.push_back(first->has(i) ? FlowStore::Loader([=] { return *first->get(i); })
                                    : FlowStore::Loader());
  loaders.insert(loaders.end(), more.begin(), more.end());
  return FlowStore(std::move(loaders), options);
}

FlowStore true_flows(const Scene& scene, const std::vector<FlowPair>& pairs,
                     const FrameStore& frames) {
  std::vector<FlowStore::Loader> loaders;
  for (const FlowPair& pair : pairs) {
    const Frame frame = scene.train[size_t(pair.frame)];
    const Camera camera = frames.camera(frame);
    const bool camera_is_static =
        pair.next < 0 || scene.train[size_t(pair.next)].camera == frame.camera;
    if (frame.flow_path.empty() || is_backward_in_time(scene, pair) || !camera_is_static)
      loaders.emplace_back();
    else
      loaders.emplace_back([=] { return read_true_flow(frame, camera.width, camera.height); });
  }
  return FlowStore(std::move(loaders));
}

FlowStore flows_from_folder(const Scene& scene, const std::vector<FlowPair>& pairs,
                            const FrameStore& frames, const std::string& folder) {
  std::set<int> have_next;
  for (const FlowPair& pair : pairs)
    if (pair.next >= 0) have_next.insert(pair.frame);
  std::vector<FlowStore::Loader> loaders;
  for (const FlowPair& pair : pairs) {
    if (is_backward_in_time(scene, pair) || (pair.next < 0 && have_next.count(pair.frame))) {
      loaders.emplace_back();
      continue;
    }
    const Frame& frame = scene.train[size_t(pair.frame)];
    const Camera camera = frames.camera(frame);
    const std::string step =
        (path_below(folder, camera.name) / fmt::format("{:04}", frame.step)).string();
    const std::string image = (fs::path(folder) / fs::path(frame.path).stem()).string();
    std::vector<std::string> names;
    for (const std::string& base : {step, image})
      for (const char* extension : {".flo", ".flo.gz", ".png", ".npy"})
        names.push_back(base + extension);
    const std::string path = first_existing("", names);
    if (path.empty())
      throw Error(fmt::format("there is no flow of camera {} at step {}: looked for {}",
                              camera.name, frame.step, fmt::join(names, ", ")));
    const std::string& base = path.compare(0, step.size(), step) == 0 ? step : image;
    const std::string mask = first_existing("", {base + "_mask.png"});
    loaders.emplace_back([=] {
      TargetFlow target_flow{read_any_flow(path), {}};
      target_flow.confidence =
          mask.empty() ? where_valid(target_flow.flow) : read_mask(mask, target_flow.flow, 128);
      return fitted(target_flow, camera.width, camera.height, path);
    });
  }
  return FlowStore(std::move(loaders));
}

}  // namespace gflow
