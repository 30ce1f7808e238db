// SPDX-License-Identifier: Apache-2.0
// A device, its context and one in-order command queue: what every other class is given first.
// Work is only queued; nothing is waited for except by finish() and blocking reads and writes.
#pragma once
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "runtime/cl/cl_error.hpp"
#include "runtime/cl/device.hpp"
#include "runtime/cl/watchdog.hpp"

namespace gflow {

// Time one kernel took on the device, over all its launches.
struct KernelTiming {
  size_t count = 0;     // launches measured
  double total_ms = 0;  // from start to end on the device
};

struct QueueOptions {
  bool profile = false;  // keep every launch's event for timings()
  int lanes = 0;         // pixels per work-item: 16, 8, 4 or 1; 0 = what suits the device
};

// One in-order queue on one device. Movable, not copyable; not for use by two threads at once.
class Queue {
 public:
  explicit Queue(const cl::Device& device, const QueueOptions& options = {});
  Queue(Queue&&) = default;
  Queue& operator=(Queue&&) = default;
  Queue(const Queue&) = delete;
  Queue& operator=(const Queue&) = delete;

  // Waits until all queued work is done.
  void finish() {
    wait("waiting for " + info.full_name(), [&] { handle.finish(); });
  }
  // Runs f, a call of OpenCL that waits, as cl_call does, under the watchdog.
  template <class F>
  void wait(const std::string& doing, F&& f) {
    cl_call(doing, [&] { watchdog_->wait(f); });
  }
  // For destructors: waits for an event, whatever comes of it.
  void wait_quietly(const cl::Event& event) {
    watchdog_->wait([&] { clWaitForEvents(1, &event()); });
  }
  // Hands queued work to the device without waiting; for long launch sequences on GPUs.
  void flush();

  // Per kernel name, what the launches since the last reset took; waits for queued work. Empty
  // without `profile`; a launch for which the driver reports no times is left out.
  const std::map<std::string, KernelTiming>& timings();
  void reset_timings();

  // For Kernel: called after each launch with its event.
  void launched(const std::string& kernel, const cl::Event& event);
  bool keeps_events() const { return profile_; }
  // For Buffer: whether memory without contents is filled with what no result can be. In debug
  // builds, and with GFLOW_POISON_BUFFERS=1 (=0: not in debug builds either).
  bool poisons() const { return poison_; }

  cl::Device device;
  DeviceInfo info;
  int lanes;  // pixels per work-item that pixel kernels are built for
  cl::Context context;
  cl::CommandQueue handle;
  std::map<std::string, cl::Program> programs;  // built so far, by options and source (Program)

 private:
  void fold_events();

  std::unique_ptr<Watchdog> watchdog_;
  bool profile_;
  bool poison_;
  bool finish_each_launch_;  // GFLOW_SYNC=1: an error then belongs to the launch just made
  std::vector<std::pair<std::string, cl::Event>> events_;
  std::map<std::string, KernelTiming> timings_;
};

}  // namespace gflow
