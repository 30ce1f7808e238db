// SPDX-License-Identifier: Apache-2.0
// Pictures on demand. Three kinds of things are cached under one bound: a frame's picture before
// the background, its RGB, and its alpha; for pictures without alpha the first is the second.
#include "optim/data/frame_store.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <filesystem>
#include <map>
#include <mutex>
#include <thread>

#include "optim/data/image_header.hpp"
#include "optim/data/lru_cache.hpp"
#include "optim/data/video.hpp"
#include "runtime/error.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

// A decoded frame: as stored, on the background, and its alpha.
struct Decoded {
  std::shared_ptr<const Image> stored, rgb, alpha;
};

size_t bytes_of(const Decoded& decoded) {
  size_t bytes = decoded.stored->pixels.size();
  if (decoded.rgb != decoded.stored) bytes += decoded.rgb->pixels.size();
  if (decoded.alpha) bytes += decoded.alpha->pixels.size();
  return bytes;
}

Image alpha_of(const Image& rgba) {
  Image alpha{rgba.width, rgba.height, 1, {}};
  alpha.pixels.resize(rgba.pixels.size() / 4);
  for (size_t i = 0; i < alpha.pixels.size(); ++i) alpha.pixels[i] = rgba.pixels[4 * i + 3];
  return alpha;
}

// The frames of one video at the store's size: as PNG files in a folder, or in memory.
struct Unpacked {
  std::mutex mutex;
  Video video;
  std::vector<Image> frames;  // in memory, from frame 0
  explicit Unpacked(const std::string& path) : video(path) {}
};

void check_size(int width, int height, const Camera& camera, const std::string& path) {
  if (width != camera.width || height != camera.height)
    throw Error(fmt::format("picture {} is {}x{}, the others of camera {} are {}x{}", path, width,
                            height, camera.name, camera.width, camera.height));
}

}  // namespace

struct FrameStore::State {
  FrameStoreOptions options;
  std::vector<Camera> full, reduced_cameras;
  LruCache<std::string, Decoded> cache;

  std::mutex videos_mutex;
  std::map<std::string, std::unique_ptr<Unpacked>> videos;

  std::mutex queue_mutex;
  std::condition_variable queue_changed;
  std::deque<Frame> queue;
  bool stopping = false;
  std::thread worker;

  explicit State(const FrameStoreOptions& o) : options(o), cache(o.cache_bytes) {}

  Image load_picture(const Frame& frame) {
    Image image = read_image(frame.path);
    check_size(image.width, image.height, full[size_t(frame.camera)], frame.path);
    const Camera& camera = reduced_cameras[size_t(frame.camera)];
    return resized(image, camera.width, camera.height);
  }

  Unpacked& video_of(const std::string& path) {
    const std::lock_guard<std::mutex> lock(videos_mutex);
    auto& slot = videos[path];
    if (!slot) slot = std::make_unique<Unpacked>(path);
    return *slot;
  }

  Image decode_video_frame(Unpacked& unpacked, const Frame& frame, int k) {
    Image image = unpacked.video.frame(k);
    check_size(image.width, image.height, full[size_t(frame.camera)], frame.path);
    const Camera& camera = reduced_cameras[size_t(frame.camera)];
    return resized(image, camera.width, camera.height);
  }

  // Every frame up to the wanted one is decoded once, in order.
  Image load_video_frame(const Frame& frame) {
    Unpacked& unpacked = video_of(frame.path);
    const std::lock_guard<std::mutex> lock(unpacked.mutex);
    const int wanted = frame.video_frame;
    if (options.unpack_folder.empty()) {
      while (int(unpacked.frames.size()) <= wanted)
        unpacked.frames.push_back(decode_video_frame(unpacked, frame, int(unpacked.frames.size())));
      return unpacked.frames[size_t(wanted)];
    }
    const fs::path folder = fs::path(options.unpack_folder) / full[size_t(frame.camera)].name;
    const auto file = [&](int k) { return (folder / fmt::format("{:05}.png", k)).string(); };
    std::error_code failed;
    fs::create_directories(folder, failed);
    if (failed)
      throw Error(fmt::format("cannot make folder {}: {}", folder.string(), failed.message()));
    const Camera& camera = reduced_cameras[size_t(frame.camera)];
    const auto is_there = [&](int k) {
      if (!fs::exists(file(k))) return false;
      const ImageHeader header = read_image_header(file(k));
      return header.width == camera.width && header.height == camera.height;
    };
    if (is_there(wanted)) return read_image(file(wanted));
    Image image;
    for (int k = 0; k <= wanted; ++k) {
      if (k < wanted && is_there(k)) continue;
      image = decode_video_frame(unpacked, frame, k);
      write_png(file(k), image);
    }
    return image;
  }

  Decoded load(const Frame& frame) {
    Decoded decoded;
    decoded.stored = std::make_shared<const Image>(frame.video_frame >= 0 ? load_video_frame(frame)
                                                                          : load_picture(frame));
    decoded.rgb = decoded.stored;
    if (decoded.stored->channels == 4) {
      decoded.rgb =
          std::make_shared<const Image>(over_background(*decoded.stored, options.background));
      decoded.alpha = std::make_shared<const Image>(alpha_of(*decoded.stored));
    }
    return decoded;
  }

  std::shared_ptr<const Decoded> get(const Frame& frame) {
    const std::string key = fmt::format("{}#{}", frame.path, frame.video_frame);
    return cache.get(
        key, [&] { return load(frame); }, bytes_of);
  }

  void run_prefetch() {
    for (;;) {
      std::unique_lock<std::mutex> lock(queue_mutex);
      queue_changed.wait(lock, [&] { return stopping || !queue.empty(); });
      if (stopping) return;
      const Frame frame = queue.front();
      queue.pop_front();
      lock.unlock();
      try {
        get(frame);
      } catch (const std::exception&) {
        // rgb() meets the same failure and reports it to whom it concerns.
      }
    }
  }
};

FrameStore::FrameStore(const Scene& scene, const FrameStoreOptions& options)
    : state_(std::make_unique<State>(options)) {
  if (options.resolution < 1)
    throw Error(
        fmt::format("the resolution divisor is {}, expected is 1 or more", options.resolution));
  state_->full = scene.cameras;
  for (const Camera& camera : scene.cameras)
    state_->reduced_cameras.push_back(reduced(camera, options.resolution));
  for (const std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val})
    for (const Frame& frame : *split) {
      if (frame.video_frame >= 0) continue;
      const ImageHeader header = read_image_header(frame.path);
      check_size(header.width, header.height, scene.cameras[size_t(frame.camera)], frame.path);
    }
  state_->worker = std::thread([state = state_.get()] { state->run_prefetch(); });
}

FrameStore::~FrameStore() {
  {
    const std::lock_guard<std::mutex> lock(state_->queue_mutex);
    state_->stopping = true;
  }
  state_->queue_changed.notify_all();
  state_->worker.join();
}

std::shared_ptr<const Image> FrameStore::rgb(const Frame& frame) { return state_->get(frame)->rgb; }

std::shared_ptr<const Image> FrameStore::alpha(const Frame& frame) {
  return state_->get(frame)->alpha;
}

Image FrameStore::rgb_over(const Frame& frame, std::array<uint8_t, 3> background) {
  return over_background(*state_->get(frame)->stored, background);
}

void FrameStore::prefetch(const std::vector<const Frame*>& frames) {
  const std::lock_guard<std::mutex> lock(state_->queue_mutex);
  for (const Frame* frame : frames) state_->queue.push_back(*frame);
  state_->queue_changed.notify_one();
}

std::array<uint8_t, 3> FrameStore::background() const { return state_->options.background; }

const Camera& FrameStore::camera(const Frame& frame) const {
  return state_->reduced_cameras[size_t(frame.camera)];
}

const std::vector<Camera>& FrameStore::cameras() const { return state_->reduced_cameras; }

}  // namespace gflow
