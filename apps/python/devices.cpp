// SPDX-License-Identifier: Apache-2.0
#include "apps/python/devices.hpp"

#include <unistd.h>

#include "apps/common/options.hpp"

namespace gflow::python {
namespace {

// What is idle keeps its memory, so only a few are kept: engines for a small batch of cameras.
constexpr size_t kMostIdle = 8, kMostIdleGaussians = 2;

// Opened devices by the OpenCL device. Never destroyed: at exit drivers may be gone before static
// objects are, and arrays of Python objects may still refer to a device.
struct Opened {
  std::mutex mutex;
  std::map<cl_device_id, std::unique_ptr<Device>> devices;
  Device* current = nullptr;
  pid_t process = 0;
};
Opened& opened() {
  static auto* all = new Opened;
  return *all;
}

void require_same_process(const Opened& all) {
  if (all.process && all.process != ::getpid())
    throw Error(
        "rendering in a forked process: OpenCL does not work in a process that was forked after "
        "gflow opened a device; start it with multiprocessing.get_context('spawn')");
}

Device& open_device(Opened& all, const std::string& wanted) {
  require_same_process(all);
  GlobalOptions options;
  options.device = wanted;
  cl_device_id id = nullptr;
  try {
    id = find_device(wanted)();
  } catch (const Error& error) {
    throw NoUsableDevice(error.what());
  }
  std::unique_ptr<Device>& device = all.devices[id];
  if (!device) device = std::make_unique<Device>(open_queue(options));
  all.process = ::getpid();
  all.current = device.get();
  return *device;
}

std::string key_of(const EngineSettings& s) {
  return fmt::format("{} {} {} {} {}", int(s.transport), int(s.stop), s.top_k, s.detach_t1,
                     s.detach_weights);
}

}  // namespace

Device::Device(Queue opened) : queue(std::move(opened)), posed(queue), camera_gradients(queue) {}

Device::Loan<Engine> Device::engine(const EngineSettings& settings) {
  const std::string key = key_of(settings);
  const std::lock_guard<std::mutex> lock(idle_mutex_);
  const auto found = idle_.find(key);
  if (found == idle_.end()) return {new Engine(queue, settings), {this, key}};
  Loan<Engine> engine(found->second.release(), {this, key});
  idle_.erase(found);
  return engine;
}

Device::Loan<Device::Gaussians> Device::gaussians() {
  const std::lock_guard<std::mutex> lock(idle_mutex_);
  if (idle_gaussians_.empty()) return {new Gaussians, {this, ""}};
  Loan<Gaussians> gaussians(idle_gaussians_.back().release(), {this, ""});
  idle_gaussians_.pop_back();
  return gaussians;
}

void Device::take_back(const std::string& key, std::unique_ptr<Engine> engine) {
  const std::lock_guard<std::mutex> lock(idle_mutex_);
  if (idle_.size() < kMostIdle) idle_.emplace(key, std::move(engine));
}

void Device::take_back(const std::string&, std::unique_ptr<Gaussians> gaussians) {
  const std::lock_guard<std::mutex> lock(idle_mutex_);
  if (idle_gaussians_.size() < kMostIdleGaussians) idle_gaussians_.push_back(std::move(gaussians));
}

const float* Device::read(const Buffer<float>& buffer) {
  if (host.size() < buffer.size()) host.resize(buffer.size());
  buffer.read_to(queue, host.data());
  return host.data();
}

Color& Device::color(int degree) {
  std::unique_ptr<Color>& color = colors_.at(size_t(degree));
  if (!color) color = std::make_unique<Color>(queue, degree);
  return *color;
}

Device& current_device() {
  Opened& all = opened();
  const std::lock_guard<std::mutex> lock(all.mutex);
  require_same_process(all);
  return all.current ? *all.current : open_device(all, "");
}

void choose_device(const std::string& wanted) {
  Opened& all = opened();
  const std::lock_guard<std::mutex> lock(all.mutex);
  open_device(all, wanted);
}

}  // namespace gflow::python
