// SPDX-License-Identifier: Apache-2.0
// Statistics of values measured several times.
#pragma once
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <random>
#include <string>
#include <vector>

namespace gflow::bench {

using Samples = std::vector<double>;                   // one value per repeat
using KernelSamples = std::map<std::string, Samples>;  // by kernel

// Median and quartiles.
struct Spread {
  double median = 0, low = 0, high = 0;
};
inline Spread spread_of(Samples values) {
  if (values.empty()) return {};
  std::sort(values.begin(), values.end());
  const auto at = [&](double share) {  // interpolates between the nearest ranks
    const double rank = share * double(values.size() - 1);
    const size_t below = size_t(rank), above = std::min(below + 1, values.size() - 1);
    return values[below] + (rank - double(below)) * (values[above] - values[below]);
  };
  return {at(0.5), at(0.25), at(0.75)};
}

// Mean and standard deviation of a single value; 0 for fewer than two values.
struct MeanAndDeviation {
  double mean = 0, deviation = 0;
};
inline MeanAndDeviation mean_of(const Samples& values) {
  const double n = double(values.size());
  const double mean = std::accumulate(values.begin(), values.end(), 0.0) / n;
  double squares = 0;
  for (const double v : values) squares += (v - mean) * (v - mean);
  return {mean, n < 2 ? 0 : std::sqrt(squares / (n - 1))};
}

// Scales a spread by a number > 0.
inline Spread scaled(const Spread& s, double by) {
  return {s.median * by, s.low * by, s.high * by};
}

// Spread of a / b per repeat: what slows down a repeat slows down both.
inline Spread ratio_of(const Samples& a, const Samples& b) {
  Samples ratios;
  for (size_t i = 0; i < std::min(a.size(), b.size()); ++i) ratios.push_back(a[i] / b[i]);
  return spread_of(std::move(ratios));
}

// Estimated CPU time of some kernels on a CPU: the CPU time of the repeat times their share of all
// kernel time. Interference and host work are shared out among the kernels, so that parts add up to
// the whole.
inline Samples cpu_of(const Samples& times, const Samples& all, const Samples& cpu) {
  Samples used;
  for (size_t i = 0; i < times.size(); ++i) used.push_back(cpu[i] * times[i] / all[i]);
  return used;
}

// Time of some kernels per repeat; empty if none ran. Quartiles must be taken of this sum, not
// summed.
inline Samples sum_of(const KernelSamples& kernels, const std::vector<std::string>& names) {
  Samples sum;
  for (const std::string& name : names) {
    const auto found = kernels.find(name);
    if (found == kernels.end()) continue;
    sum.resize(found->second.size());
    for (size_t i = 0; i < sum.size(); ++i) sum[i] += found->second[i];
  }
  return sum;
}
inline Samples sum_of(const KernelSamples& kernels) {
  std::vector<std::string> names;
  for (const auto& [name, times] : kernels) names.push_back(name);
  return sum_of(kernels, names);
}

// Order in which `count` variants run in a repeat: shuffled, and reversed in every second repeat,
// so that of any two each comes first equally often. Deterministic.
inline std::vector<size_t> order_of(size_t count, int repeat) {
  std::vector<size_t> order(count);
  std::iota(order.begin(), order.end(), 0);
  std::mt19937 rng(unsigned(repeat) / 2);
  std::shuffle(order.begin(), order.end(), rng);
  if (repeat % 2) std::reverse(order.begin(), order.end());
  return order;
}

}  // namespace gflow::bench
