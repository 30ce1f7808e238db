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
  std::vector<double> wall, cpu;
  std::map<std::string, std::vector<double>> kernels;
  for (int i = -kWarm; i < repeats; ++i) {
    queue.finish();
    queue.reset_timings();
    const double wall_start = wall_ms(), cpu_start = cpu_seconds();
    work();
    queue.finish();
    if (i < 0) continue;
    cpu.push_back(1e3 * (cpu_seconds() - cpu_start));
    wall.push_back(wall_ms() - wall_start);
    for (const auto& [name, timing] : queue.timings()) kernels[name].push_back(timing.total_ms);
  }
  Cost cost{spread_of(wall), spread_of(cpu), {}};
  for (const auto& [name, times] : kernels) cost.kernel_ms[name] = spread_of(times);
  return cost;
}

}  // namespace gflow::bench
