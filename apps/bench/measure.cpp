// SPDX-License-Identifier: Apache-2.0
#include "apps/bench/measure.hpp"

#include <algorithm>
#include <chrono>

#include "runtime/usage.hpp"

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
    cpu_.push_back(1e3 * (cpu_seconds() - cpu_start));
    wall_.push_back(wall_ms() - wall_start);
    for (const auto& [name, timing] : queue_.timings()) kernels_[name].push_back(timing.total_ms);
  }
  Cost cost() const {
    Cost cost{spread_of(wall_), spread_of(cpu_), {}};
    for (const auto& [name, times] : kernels_) cost.kernel_ms[name] = spread_of(times);
    return cost;
  }

 private:
  Queue& queue_;
  const std::function<void()>& work_;
  std::vector<double> wall_, cpu_;
  std::map<std::string, std::vector<double>> kernels_;
};

}  // namespace

Spread spread_of(std::vector<double> values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  const auto at = [&](double share) {  // between the two nearest ranks
    const double rank = share * double(values.size() - 1);
    const size_t below = size_t(rank), above = std::min(below + 1, values.size() - 1);
    return values[below] + (rank - double(below)) * (values[above] - values[below]);
  };
  return {at(0.5), at(0.25), at(0.75)};
}

Cost cost_of(Queue& queue, int repeats, const std::function<void()>& work) {
  Timed timed(queue, work);
  for (int i = -kWarm; i < repeats; ++i) timed.run(i >= 0);
  return timed.cost();
}

std::pair<Cost, Cost> costs_in_turn(Queue& queue_a, const std::function<void()>& a, Queue& queue_b,
                                    const std::function<void()>& b, int repeats) {
  Timed first(queue_a, a), second(queue_b, b);
  for (int i = -kWarm; i < repeats; ++i) {
    first.run(i >= 0);
    second.run(i >= 0);
  }
  return {first.cost(), second.cost()};
}

}  // namespace gflow::bench
