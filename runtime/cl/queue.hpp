// SPDX-License-Identifier: Apache-2.0
// A device, its context and one in-order command queue, which every other class is given first.
// Work is only queued: nothing waits except finish() and blocking reads and writes.
#pragma once
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "runtime/cl/cl_error.hpp"
#include "runtime/cl/device.hpp"
#include "runtime/cl/watchdog.hpp"

namespace gflow {

// Time of one kernel on the device, over all its launches.
struct KernelTiming {
  size_t count = 0;     // launches measured
  double total_ms = 0;  // from start to end on the device
};

struct QueueOptions {
  bool profile = false;  // keep every launch's event for timings()
  int lanes = 0;         // vector width: 16, 8, 4 or 1; 0: chosen for the device
};

// One in-order queue on one device. Movable, not copyable; not for two threads at once.
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
  // Runs f, an OpenCL call that waits, as cl_call does, under the watchdog.
  template <class F>
  void wait(const std::string& doing, F&& f) {
    cl_call(doing, [&] { watchdog_->wait(f); });
  }
  // For destructors: waits for an event and ignores errors.
  void wait_quietly(const cl::Event& event) {
    watchdog_->wait([&] { clWaitForEvents(1, &event()); });
  }
  // Hands queued work to the device without waiting; for long launch sequences on GPUs.
  void flush();

  // Time per kernel name since the last reset; waits for queued work. Empty without `profile`;
  // launches for which the driver reports no times are left out.
  const std::map<std::string, KernelTiming>& timings();
  void reset_timings();

  // For Kernel: called after each launch with its event.
  void launched(const std::string& kernel, const cl::Event& event);
  bool keeps_events() const { return profile_; }
  // For Buffer: whether fresh memory is filled with `poison`. On in debug builds;
  // GFLOW_POISON_BUFFERS=1 or 0 overrides it.
  bool poisons() const { return poison_; }

  cl::Device device;
  DeviceInfo info;
  int lanes;  // vector width that pixel kernels are built for
  cl::Context context;
  cl::CommandQueue handle;
  std::map<std::string, cl::Program> programs;  // built so far, by options and source (Program)

 private:
  void collect_timings();

  std::unique_ptr<Watchdog> watchdog_;
  bool profile_;
  bool poison_;
  bool finish_each_launch_;  // GFLOW_SYNC=1: an error belongs to the launch just made
  std::vector<std::pair<std::string, cl::Event>> events_;
  std::map<std::string, KernelTiming> timings_;
};

}  // namespace gflow
