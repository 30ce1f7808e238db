// SPDX-License-Identifier: Apache-2.0
// Flows on demand.
#include "optim/data/flow_store.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <atomic>
#include <exception>
#include <filesystem>
#include <mutex>
#include <opencv2/core/utility.hpp>
#include <set>
#include <thread>

#include "optim/data/image_header.hpp"
#include "optim/data/lru_cache.hpp"
#include "optim/data/reader_util.hpp"
#include "optim/io/atomic_file.hpp"
#include "optim/io/npy.hpp"
#include "runtime/error.hpp"

namespace gflow {
namespace fs = std::filesystem;
namespace {

// Behind pictures with alpha: differs from dark and from bright objects, so that both kinds keep
// their outlines. Error over moving pixels on black / grey / white, seven frame pairs each, against
// true flow: dark fox 0.81 / 0.88 / 0.88 px, metal hammer 0.19 / 0.16 / 0.20 px.
constexpr std::array<uint8_t, 3> mid_grey = {128, 128, 128};

std::vector<uint8_t> where_valid(const FlowField& flow) {
  std::vector<uint8_t> confidence(flow.valid.size());
  for (size_t i = 0; i < confidence.size(); ++i) confidence[i] = flow.valid[i] ? 255 : 0;
  return confidence;
}

// A mask of the flow's size; kept where it is at least `threshold`.
std::vector<uint8_t> read_mask(const std::string& path, const FlowField& flow, int threshold) {
  const Image mask = read_grey(path);
  if (mask.width != flow.width || mask.height != flow.height)
    throw Error(fmt::format("mask {} is {}x{}, its flow is {}x{}", path, mask.width, mask.height,
                            flow.width, flow.height));
  std::vector<uint8_t> confidence = where_valid(flow);
  for (size_t i = 0; i < confidence.size(); ++i)
    if (mask.pixels[i] < threshold) confidence[i] = 0;
  return confidence;
}

// Brings a flow to the frame's resolution. Error when its shape is another than the camera's.
TeacherFlow fitted(const TeacherFlow& teacher, int width, int height, const std::string& path) {
  const double sx = double(width) / teacher.flow.width, sy = double(height) / teacher.flow.height;
  if (!(sx / sy > 0.98 && sx / sy < 1.02))
    throw Error(fmt::format("flow {} is {}x{}, its picture is {}x{}", path, teacher.flow.width,
                            teacher.flow.height, width, height));
  return resized(teacher, width, height);
}

FlowField flow_from_npy(const std::string& path) {
  const Array array = read_npy(path);
  const auto& shape = array.shape;
  if (shape.size() != 3 || shape[2] != 2 || shape[0] < 1 || shape[1] < 1 || shape[0] > 32768 ||
      shape[1] > 32768)
    throw Error(fmt::format("flow {} has shape {}, expected is (height, width, 2)", path,
                            array.shape_text()));
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

// Where the estimate of a frame is kept.
struct CacheFiles {
  std::string flow, mask;
  CacheFiles(const std::string& folder, const Scene& scene, const FlowPair& pair) {
    const Frame& a = scene.train[size_t(pair.frame)];
    const std::string name =
        (fs::path(folder) / a.name).string() + (leads_back(scene, pair) ? "_back" : "");
    flow = name + ".flo";
    mask = name + "_mask.png";
  }
};

// True when both files are whole and of the camera's size.
bool is_cached(const CacheFiles& files, const Camera& camera) {
  std::error_code failed;
  const auto size = fs::file_size(files.flow, failed);
  if (failed || size != 12 + 8 * size_t(camera.width) * size_t(camera.height)) return false;
  if (!fs::exists(files.mask)) return false;
  const ImageHeader header = read_image_header(files.mask);
  return header.width == camera.width && header.height == camera.height;
}

void write_teacher(const CacheFiles& files, const TeacherFlow& teacher) {
  write_flo(files.flow, teacher.flow);
  write_png(files.mask, {teacher.flow.width, teacher.flow.height, 1, teacher.confidence});
}

// The flows of a pair both ways: the check of one needs the other.
void estimate_into(const std::string& folder, const Scene& scene, const FlowPair& pair,
                   FrameStore& frames) {
  const Frame& a = scene.train[size_t(pair.frame)];
  const Frame& b = scene.train[size_t(pair.next)];
  const CacheFiles there(folder, scene, pair), back(folder, scene, {pair.next, pair.frame});
  if (is_cached(there, frames.camera(a)) && is_cached(back, frames.camera(b))) return;
  const auto [forward, backward] =
      estimate_teacher_flows(frames.rgb_over(a, mid_grey), frames.rgb_over(b, mid_grey));
  write_teacher(there, forward);
  write_teacher(back, backward);
}

// The pairs with two frames, each once, as {earlier, later} index.
std::vector<FlowPair> without_direction(const std::vector<FlowPair>& pairs) {
  std::set<std::pair<int, int>> seen;
  for (const FlowPair& pair : pairs)
    if (pair.next >= 0) seen.insert(std::minmax(pair.frame, pair.next));
  std::vector<FlowPair> once;
  for (const auto& [a, b] : seen) once.push_back({a, b});
  return once;
}

// Error when the estimates that are not there yet will not fit on the disk: better now than hours
// later.
void require_room(const std::string& folder, const Scene& scene, const std::vector<FlowPair>& work,
                  const FrameStore& frames) {
  uint64_t bytes = 0;
  for (const FlowPair& pair : work)
    for (const FlowPair& way : {pair, FlowPair{pair.next, pair.frame}}) {
      const Camera& camera = frames.camera(scene.train[size_t(way.frame)]);
      if (!is_cached(CacheFiles(folder, scene, way), camera))
        bytes += 12 + 8 * uint64_t(camera.width) * uint64_t(camera.height);
    }
  require_free_space(folder, bytes,
                     fmt::format("optical flow of {} pairs of pictures", work.size()),
                     "train smaller pictures (-r 2) or fewer of them (scene.stride, "
                     "scene.max_steps), without flow (flow.enabled = false), or into a folder on "
                     "another disk");
}

// Runs work(i) for i in 0..n-1 on several threads. The first exception ends the work and is thrown
// here.
void for_each_parallel(size_t n, int threads, const std::function<void(size_t)>& work) {
  if (threads <= 0) threads = int(std::max(1u, std::thread::hardware_concurrency()));
  std::atomic<size_t> next{0};
  std::mutex mutex;
  std::exception_ptr first;
  const auto run = [&] {
    for (size_t i; (i = next++) < n;) {
      try {
        work(i);
      } catch (...) {
        const std::lock_guard<std::mutex> lock(mutex);
        if (!first) first = std::current_exception();
        next = n;
      }
    }
  };
  std::vector<std::thread> workers;
  for (size_t t = 0; t < std::min(size_t(threads), n); ++t) workers.emplace_back(run);
  for (std::thread& worker : workers) worker.join();
  if (first) std::rethrow_exception(first);
}

// The scene's parallelism is over pairs; OpenCV's own threads would only be in the way. They come
// back afterwards.
class OneOpenCvThread {
 public:
  OneOpenCvThread() : before_(cv::getNumThreads()) { cv::setNumThreads(1); }
  OneOpenCvThread(const OneOpenCvThread&) = delete;
  OneOpenCvThread& operator=(const OneOpenCvThread&) = delete;
  ~OneOpenCvThread() { cv::setNumThreads(before_); }

 private:
  int before_;
};

}  // namespace

struct FlowStore::State {
  std::vector<Loader> loaders;
  LruCache<size_t, TeacherFlow> cache;
  State(std::vector<Loader> l, size_t bytes) : loaders(std::move(l)), cache(bytes) {}
};

FlowStore::FlowStore(std::vector<Loader> loaders, size_t cache_bytes)
    : state_(std::make_unique<State>(std::move(loaders), cache_bytes)) {}
FlowStore::~FlowStore() = default;
FlowStore::FlowStore(FlowStore&&) noexcept = default;
FlowStore& FlowStore::operator=(FlowStore&&) noexcept = default;

size_t FlowStore::size() const { return state_->loaders.size(); }

bool FlowStore::has(size_t pair) const { return pair < size() && state_->loaders[pair]; }

std::shared_ptr<const TeacherFlow> FlowStore::get(size_t pair) {
  if (!has(pair)) throw Error(fmt::format("there is no flow for frame pair {}", pair));
  return state_->cache.get(pair, state_->loaders[pair], [](const TeacherFlow& teacher) {
    return teacher.flow.uv.size() * sizeof(float) + 2 * teacher.confidence.size();
  });
}

FlowStore estimated_flows(const Scene& scene, const std::vector<FlowPair>& pairs,
                          FrameStore& frames, const std::string& cache, int threads,
                          const ProgressCallback& progress) {
  std::error_code failed;
  fs::create_directories(cache, failed);
  if (failed) throw Error(fmt::format("cannot make folder {}: {}", cache, failed.message()));

  const OneOpenCvThread guard;
  std::mutex progress_mutex;
  size_t done = 0;
  const std::vector<FlowPair> work = without_direction(pairs);
  require_room(cache, scene, work, frames);
  for_each_parallel(work.size(), threads, [&](size_t i) {
    estimate_into(cache, scene, work[i], frames);
    const std::lock_guard<std::mutex> lock(progress_mutex);
    ++done;
    if (progress) progress(done, work.size());
  });

  std::vector<FlowStore::Loader> loaders;
  for (const FlowPair& pair : pairs) {
    if (pair.next < 0) {
      loaders.emplace_back();
      continue;
    }
    const CacheFiles files(cache, scene, pair);
    loaders.emplace_back([files] {
      TeacherFlow teacher{read_flo(files.flow), {}};
      teacher.confidence = read_mask(files.mask, teacher.flow, 128);
      return teacher;
    });
  }
  return FlowStore(std::move(loaders));
}

TeacherFlow read_true_flow(const Frame& frame, int width, int height) {
  if (frame.flow_path.empty())
    throw Error(fmt::format("frame {} comes without a true flow", frame.name));
  TeacherFlow teacher{read_flo(frame.flow_path), {}};
  teacher.confidence = frame.flow_mask_path.empty()
                           ? where_valid(teacher.flow)
                           : read_mask(frame.flow_mask_path, teacher.flow, 255);
  return fitted(teacher, width, height, frame.flow_path);
}

FlowStore true_flows(const Scene& scene, const std::vector<FlowPair>& pairs,
                     const FrameStore& frames) {
  std::vector<FlowStore::Loader> loaders;
  for (const FlowPair& pair : pairs) {
    const Frame frame = scene.train[size_t(pair.frame)];
    const Camera camera = frames.camera(frame);
    const bool rests = pair.next < 0 || scene.train[size_t(pair.next)].camera == frame.camera;
    if (frame.flow_path.empty() || leads_back(scene, pair) || !rests)
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
    if (leads_back(scene, pair) || (pair.next < 0 && have_next.count(pair.frame))) {
      loaders.emplace_back();
      continue;
    }
    const Frame& frame = scene.train[size_t(pair.frame)];
    const Camera camera = frames.camera(frame);
    const std::string step =
        (fs::path(folder) / camera.name / fmt::format("{:04}", frame.step)).string();
    const std::string picture = (fs::path(folder) / fs::path(frame.path).stem()).string();
    std::vector<std::string> names;
    for (const std::string& base : {step, picture})
      for (const char* extension : {".flo", ".flo.gz", ".png", ".npy"})
        names.push_back(base + extension);
    const std::string path = first_existing("", names);
    if (path.empty())
      throw Error(fmt::format("there is no flow of camera {} at step {}: looked for {}",
                              camera.name, frame.step, fmt::join(names, ", ")));
    const std::string& base = path.compare(0, step.size(), step) == 0 ? step : picture;
    const std::string mask = first_existing("", {base + "_mask.png"});
    loaders.emplace_back([=] {
      TeacherFlow teacher{read_any_flow(path), {}};
      teacher.confidence =
          mask.empty() ? where_valid(teacher.flow) : read_mask(mask, teacher.flow, 128);
      return fitted(teacher, camera.width, camera.height, path);
    });
  }
  return FlowStore(std::move(loaders));
}

}  // namespace gflow
