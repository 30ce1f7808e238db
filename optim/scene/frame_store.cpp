// SPDX-License-Identifier: Apache-2.0
// Images on demand. One memory bound covers three images per frame: as stored, RGB over the
// background, and alpha. For images without alpha the first two are the same.
#include "optim/scene/frame_store.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <filesystem>
#include <map>
#include <mutex>
#include <set>
#include <system_error>
#include <thread>

#include "optim/images/image_header.hpp"
#include "optim/images/lru_cache.hpp"
#include "optim/images/opencv_threads.hpp"
#include "optim/images/video.hpp"
#include "optim/scene/lens.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/warning.hpp"
#include "runtime/files/file_name.hpp"
#include "runtime/files/temporary_folder.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

// A decoded frame: as stored, composited over the background, its alpha, and the pixels that count.
struct Decoded {
  std::shared_ptr<const Image> stored, rgb, alpha, mask;
};

size_t bytes_of(const Decoded& decoded) {
  size_t bytes = decoded.stored->pixels.size();
  if (decoded.rgb != decoded.stored) bytes += decoded.rgb->pixels.size();
  if (decoded.alpha) bytes += decoded.alpha->pixels.size();
  if (decoded.mask) bytes += decoded.mask->pixels.size();
  return bytes;
}

Image alpha_of(const Image& rgba) {
  Image alpha{rgba.width, rgba.height, 1, {}};
  alpha.pixels.resize(rgba.pixels.size() / 4);
  for (size_t i = 0; i < alpha.pixels.size(); ++i) alpha.pixels[i] = rgba.pixels[4 * i + 3];
  return alpha;
}

// 0 or 255 from a mask; label masks of 0 and 1 count as 0 and 255. A pixel that is resized from
// both does not count.
Image binary(Image mask, uint8_t at_least) {
  for (uint8_t& value : mask.pixels) value = value >= at_least ? 255 : 0;
  return mask;
}
Image two_levels(Image mask) {
  const uint8_t most = *std::max_element(mask.pixels.begin(), mask.pixels.end());
  return binary(std::move(mask), most == 1 ? 1 : 128);
}

// Multiplies a mask into the alpha channel. Label masks of 0 and 1 count as 0 and 255.
Image masked(const Image& image, Image mask) {
  const uint8_t most = *std::max_element(mask.pixels.begin(), mask.pixels.end());
  if (most == 1)
    for (uint8_t& value : mask.pixels) value = uint8_t(255 * value);
  Image rgba{image.width, image.height, 4, {}};
  rgba.pixels.reserve(4 * mask.pixels.size());
  for (size_t i = 0; i < mask.pixels.size(); ++i) {
    const uint8_t* p = &image.pixels[i * size_t(image.channels)];
    const int alpha = image.channels == 4 ? p[3] : 255;
    rgba.pixels.insert(rgba.pixels.end(),
                       {p[0], p[1], p[2], uint8_t((alpha * mask.pixels[i] + 127) / 255)});
  }
  return rgba;
}

// One video; only one thread reads it at a time.
struct Unpacked {
  std::mutex mutex;
  Video video;
  explicit Unpacked(const std::string& path) : video(path) {}
};

void check_size(int width, int height, const Camera& camera, const std::string& path) {
  if (width != camera.width || height != camera.height)
    throw Error(fmt::format("image {} is {}x{}, but the other images of camera {} are {}x{}", path,
                            width, height, camera.name, camera.width, camera.height));
}

// A mask may be larger or smaller than its image, of the same shape.
void check_mask_shape(int width, int height, const Camera& camera, const std::string& path) {
  constexpr double same_shape = 0.02;
  const double ratio = double(width) * camera.height / (double(height) * camera.width);
  if (std::fabs(ratio - 1) > same_shape)
    throw Error(fmt::format("mask {} is {}x{}, but its image is {}x{}: expected the same shape",
                            path, width, height, camera.width, camera.height));
}

Image read_mask(const std::string& path, const Camera& camera) {
  const Image mask = read_grey(path);
  check_mask_shape(mask.width, mask.height, camera, path);
  return resized(mask, camera.width, camera.height);
}

}  // namespace

struct FrameStore::State {
  FrameStoreOptions options;
  Masks masks = Masks::alpha;
  std::vector<Camera> full, reduced_cameras;  // decoding uses them
  std::vector<Camera> moved;                  // at the store's resolution
  LruCache<std::string, Decoded> cache;

  std::mutex videos_mutex;
  std::map<std::string, std::unique_ptr<Unpacked>> videos;
  std::map<std::string, std::set<int>> used;  // frames of each video used by the scene
  std::unique_ptr<ScratchFolder> temporary;

  std::mutex queue_mutex;
  std::condition_variable queue_changed;
  std::deque<Frame> queue;
  bool stopping = false;
  std::thread worker;

  explicit State(const FrameStoreOptions& o) : options(o), cache(o.cache_bytes) {}

  // The stored image undistorted and resized to the store's resolution.
  Image prepared(const Image& image, const Frame& frame) const {
    const Camera& camera = full[size_t(frame.camera)];
    check_size(image.width, image.height, camera, frame.path);
    const Camera& small = reduced_cameras[size_t(frame.camera)];
    return resized(undistorted(image, camera), small.width, small.height);
  }

  Image load_image(const Frame& frame) const {
    const Image image = frame.image ? *frame.image : read_image(frame.path);
    if (frame.mask_path.empty() || masks != Masks::alpha) return prepared(image, frame);
    const Image mask = read_mask(frame.mask_path, full[size_t(frame.camera)]);
    check_size(image.width, image.height, full[size_t(frame.camera)], frame.path);
    return prepared(masked(image, mask), frame);
  }

  // A mask in memory or of a file, in the size of the image: 255 where all of it is white.
  Image resized_to(const Image& mask, const Frame& frame) const {
    const Camera& small = reduced_cameras[size_t(frame.camera)];
    return binary(resized(two_levels(mask), small.width, small.height), 255);
  }
  Image read_levels(const Frame& frame) const {
    const Image mask = read_mask(frame.mask_path, full[size_t(frame.camera)]);
    return binary(prepared(two_levels(mask), frame), 255);
  }

  // The mask of a frame if it means ignore or foreground, 0 and 255; null without, or if it is
  // white everywhere.
  std::shared_ptr<const Image> load_mask(const Frame& frame) const {
    if (frame.mask_path.empty() || masks == Masks::alpha) return nullptr;
    Image levels = frame.mask ? resized_to(*frame.mask, frame) : read_levels(frame);
    const bool all = std::all_of(levels.pixels.begin(), levels.pixels.end(),
                                 [](uint8_t value) { return value == 255; });
    if (masks == Masks::ignore && std::count(levels.pixels.begin(), levels.pixels.end(), 255) == 0)
      warn_once(fmt::format("mask {} is black everywhere: no pixel of {} counts", frame.mask_path,
                            frame.path));
    return all ? nullptr : std::make_shared<const Image>(std::move(levels));
  }

  Unpacked& video_of(const std::string& path) {
    const std::lock_guard<std::mutex> lock(videos_mutex);
    auto& slot = videos[path];
    if (!slot) slot = std::make_unique<Unpacked>(path);
    return *slot;
  }

  // Frames are unpacked in order: all used frames up to this one that are not yet on disk.
  Image load_video_frame(const Frame& frame) {
    Unpacked& unpacked = video_of(frame.path);
    const std::lock_guard<std::mutex> lock(unpacked.mutex);
    const Camera& camera = reduced_cameras[size_t(frame.camera)];
    const fs::path folder = fs::path(options.unpack_folder) / as_file_name(camera.name);
    const auto file = [&](int k) { return (folder / fmt::format("{:05}.png", k)).string(); };
    std::error_code failed;
    fs::create_directories(folder, failed);
    if (failed)
      throw Error(fmt::format("cannot create folder {}: {}", folder.string(), failed.message()));
    // A damaged file counts as missing: its frame can be unpacked again.
    const auto damaged = [](const Error& problem) {
      warn(fmt::format("{}; decoding this frame from the video again", problem.what()));
    };
    const auto is_there = [&](int k) {
      try {
        if (!fs::exists(file(k))) return false;
        const ImageHeader header = read_image_header(file(k));
        return header.width == camera.width && header.height == camera.height;
      } catch (const Error& problem) {
        damaged(problem);
        return false;
      }
    };
    try {
      if (is_there(frame.video_frame)) return read_image(file(frame.video_frame));
    } catch (const Error& problem) {
      damaged(problem);
    }
    const auto unpack = [&](int k) {
      Image image = prepared(unpacked.video.frame(k), frame);
      write_png(file(k), image);
      return image;
    };
    for (const int k : used.at(frame.path)) {
      if (k >= frame.video_frame) break;
      if (!is_there(k)) unpack(k);
    }
    return unpack(frame.video_frame);
  }

  Decoded load(const Frame& frame) {
    Decoded decoded;
    decoded.stored = std::make_shared<const Image>(frame.video_frame >= 0 ? load_video_frame(frame)
                                                                          : load_image(frame));
    decoded.rgb = decoded.stored;
    decoded.mask = load_mask(frame);
    if (decoded.stored->channels == 4) {
      decoded.rgb =
          std::make_shared<const Image>(over_background(*decoded.stored, options.background));
      decoded.alpha = std::make_shared<const Image>(alpha_of(*decoded.stored));
    }
    return decoded;
  }

  std::shared_ptr<const Decoded> get(const Frame& frame) {
    const std::string key = fmt::format("{}#{}#{}", frame.path, frame.video_frame, frame.mask_path);
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
        // rgb() will fail in the same way and report it.
      }
    }
  }
};

FrameStore::FrameStore(const Scene& scene, const FrameStoreOptions& options)
    : state_(std::make_unique<State>(options)) {
  if (options.resolution < 1)
    throw Error(
        fmt::format("the resolution divisor is {}, expected 1 or more", options.resolution));
  limit_opencv_to_one_thread();
  state_->full = scene.cameras;
  state_->masks = scene.masks;
  for (const Camera& camera : scene.cameras) {
    state_->reduced_cameras.push_back(reduced(camera, options.resolution));
    state_->reduced_cameras.back().lens = {};
  }
  state_->moved = state_->reduced_cameras;
  for (const std::vector<Frame>* split : {&scene.train, &scene.test, &scene.val})
    for (const Frame& frame : *split) {
      if (frame.video_frame >= 0) {
        state_->used[frame.path].insert(frame.video_frame);
        continue;
      }
      if (frame.image)
        check_size(frame.image->width, frame.image->height, scene.cameras[size_t(frame.camera)],
                   frame.path);
      const Camera& camera = scene.cameras[size_t(frame.camera)];
      if (!frame.image && !frame.path.empty()) {
        const ImageHeader header = read_image_header(frame.path);
        check_size(header.width, header.height, camera, frame.path);
      }
      if (!frame.mask && !frame.mask_path.empty()) {
        const ImageHeader header = read_image_header(frame.mask_path);
        check_mask_shape(header.width, header.height, camera, frame.mask_path);
      }
    }
  if (!state_->used.empty() && options.unpack_folder.empty()) {
    state_->temporary = std::make_unique<ScratchFolder>("frames");
    state_->options.unpack_folder = state_->temporary->path();
  }
  try {
    state_->worker = std::thread([state = state_.get()] { state->run_prefetch(); });
  } catch (const std::system_error&) {  // out of threads: frames are decoded on request
  }
}

FrameStore::~FrameStore() {
  {
    const std::lock_guard<std::mutex> lock(state_->queue_mutex);
    state_->stopping = true;
  }
  state_->queue_changed.notify_all();
  if (state_->worker.joinable()) state_->worker.join();
}

std::shared_ptr<const Image> FrameStore::rgb(const Frame& frame) { return state_->get(frame)->rgb; }

std::shared_ptr<const Image> FrameStore::alpha(const Frame& frame) {
  return state_->get(frame)->alpha;
}

std::shared_ptr<const Image> FrameStore::foreground(const Frame& frame) {
  return state_->masks == Masks::foreground ? state_->get(frame)->mask : nullptr;
}

std::shared_ptr<const Image> FrameStore::counted(const Frame& frame) {
  return state_->masks == Masks::ignore ? state_->get(frame)->mask : nullptr;
}

std::shared_ptr<const Image> FrameStore::image(const Frame& frame) {
  return state_->get(frame)->stored;
}

Image FrameStore::rgb_over(const Frame& frame, std::array<uint8_t, 3> background) {
  return over_background(*state_->get(frame)->stored, background);
}

void FrameStore::prefetch(const std::vector<const Frame*>& frames) {
  const std::lock_guard<std::mutex> lock(state_->queue_mutex);
  state_->queue.clear();
  for (const Frame* frame : frames) state_->queue.push_back(*frame);
  state_->queue_changed.notify_one();
}

std::array<uint8_t, 3> FrameStore::background() const { return state_->options.background; }

const Camera& FrameStore::camera(const Frame& frame) const {
  return state_->moved[size_t(frame.camera)];
}

const std::vector<Camera>& FrameStore::cameras() const { return state_->moved; }

void FrameStore::move_camera(size_t index, const Eigen::Matrix4d& viewmat, double focal) {
  Camera& camera = state_->moved[index];
  const Camera& start = state_->reduced_cameras[index];
  camera.viewmat = viewmat;
  camera.fx = focal * start.fx;
  camera.fy = focal * start.fy;
}

std::vector<Camera> FrameStore::moved_cameras() const {
  std::vector<Camera> cameras = state_->full;
  for (size_t i = 0; i < cameras.size(); ++i) {
    cameras[i].viewmat = state_->moved[i].viewmat;
    cameras[i].fx *= state_->moved[i].fx / state_->reduced_cameras[i].fx;
    cameras[i].fy *= state_->moved[i].fy / state_->reduced_cameras[i].fy;
  }
  return cameras;
}

}  // namespace gflow
