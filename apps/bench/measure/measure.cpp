// SPDX-License-Identifier: Apache-2.0
#include "apps/bench/measure/measure.hpp"

#include <chrono>

#include "runtime/base/usage.hpp"

namespace gflow::bench {
namespace {

constexpr int kWarm = 2;

double wall_ms() {
  const auto now = std::chrono::steady_clock::now().time_since_epoch();
  return std::chrono::duration<double, std::milli>(now).count();
}

class Timed {
 public:
  Timed(Queue& queue, const std::function<void()>& work) : queue_(queue), work_(work) {}

  void run(bool counts) {
    queue_.finish();
    queue_.reset_timings();
    const double wall_start = wall_ms(), cpu_start = cpu_seconds();
    work_();
    queue_.finish();
    if (!counts) return;
    cost.cpu_ms.push_back(1e3 * (cpu_seconds() - cpu_start));
    cost.wall_ms.push_back(wall_ms() - wall_start);
    append_kernels(cost.kernel_ms, queue_, cost.wall_ms.size() - 1, 1);
  }

  Cost cost;

 private:
  Queue& queue_;
  const std::function<void()>& work_;
};

}  // namespace

void append_kernels(KernelSamples& kernels, Queue& queue, size_t repeat, int runs) {
  for (const auto& [name, timing] : queue.timings()) {
    Samples& times = kernels[name];
    times.resize(repeat + 1);
    times[repeat] = timing.total_ms / runs;
  }
  for (auto& [name, times] : kernels) times.resize(repeat + 1);
}

Cost cost_of(Queue& queue, int repeats, const std::function<void()>& work) {
  Timed timed(queue, work);
  for (int i = -kWarm; i < repeats; ++i) timed.run(i >= 0);
  return timed.cost;
}

std::pair<Cost, Cost> costs_in_turn(Queue& queue_a, const std::function<void()>& a, Queue& queue_b,
                                    const std::function<void()>& b, int repeats) {
  Timed both[]{{queue_a, a}, {queue_b, b}};
  for (int i = 0; i < kWarm + repeats; ++i)
    for (const size_t k : order_of(2, i)) both[k].run(i >= kWarm);
  return {both[0].cost, both[1].cost};
}

}  // namespace gflow::bench
