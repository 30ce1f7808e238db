// SPDX-License-Identifier: Apache-2.0
// The queue's construction, waiting and event timings.
#include "runtime/cl/queue.hpp"

#include <fmt/format.h>

#include "runtime/cl/environment.hpp"

namespace gflow {
namespace {

#ifdef NDEBUG
constexpr bool debug_build = false;
#else
constexpr bool debug_build = true;
#endif

int checked_lanes(int asked, const DeviceInfo& info) {
  const int lanes = asked ? asked : info.lanes;
  if (lanes != 1 && lanes != 4 && lanes != 8 && lanes != 16)
    throw Error(
        fmt::format("lanes is {}; it must be 1, 4, 8 or 16 (0 = chosen for the device)", lanes));
  require_usable(info, lanes);
  return lanes;
}

}  // namespace

Queue::Queue(const cl::Device& device, const QueueOptions& options)
    : device(device),
      info(device_info(device)),
      lanes(checked_lanes(options.lanes, info)),
      watchdog_(std::make_unique<Watchdog>(info.full_name(), device_timeout())),
      profile_(options.profile),
      poison_(environment_flag("GFLOW_POISON_BUFFERS", debug_build)),
      finish_each_launch_(environment_flag("GFLOW_SYNC", false)) {
  wait("creating a queue on " + info.full_name(), [&] {
    context = cl::Context(device);
    handle = cl::CommandQueue(context, device, profile_ ? CL_QUEUE_PROFILING_ENABLE : 0);
  });
}

void Queue::flush() {
  cl_call("flushing the queue of " + info.full_name(), [&] { handle.flush(); });
}

void Queue::launched(const std::string& kernel, const cl::Event& event) {
  if (finish_each_launch_) wait("running kernel " + kernel, [&] { handle.finish(); });
  if (!profile_) return;
  events_.emplace_back(kernel, event);
  const size_t most_kept = 4096;  // bounds the driver objects of a long training
  if (events_.size() >= most_kept) collect_timings();
}

void Queue::collect_timings() {
  finish();
  cl_call("reading kernel times of " + info.full_name(), [&] {
    for (const auto& [kernel, event] : events_) {
      const auto start = event.getProfilingInfo<CL_PROFILING_COMMAND_START>();
      const auto end = event.getProfilingInfo<CL_PROFILING_COMMAND_END>();
      if (end == 0) continue;  // some drivers (rusticl of Mesa 22) report nothing
      auto& timing = timings_[kernel];
      ++timing.count;
      timing.total_ms += double(end - start) * 1e-6;
    }
  });
  events_.clear();
}

const std::map<std::string, KernelTiming>& Queue::timings() {
  collect_timings();
  return timings_;
}

void Queue::reset_timings() {
  events_.clear();
  timings_.clear();
}

}  // namespace gflow
