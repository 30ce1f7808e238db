// SPDX-License-Identifier: Apache-2.0
#include "optim/train/curriculum.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>

#include "shared/random.h"

namespace gflow {
namespace {

constexpr size_t kFrontViews = 12;  // outermost views

}  // namespace

size_t shuffled(size_t n, uint32_t seed, size_t i) {
  const uint round = uint(i / n);
  std::vector<size_t> order(n);
  std::iota(order.begin(), order.end(), size_t(0));
  for (size_t k = n - 1; k > 0; --k)  // Fisher-Yates
    std::swap(order[k], order[random_bits(seed, round, uint(k)) % (k + 1)]);
  return order[i % n];
}

double moment_to_begin(const std::vector<Frame>& frames) {
  std::map<double, int> frame_counts;
  for (const Frame& frame : frames) ++frame_counts[frame.time];
  double best = 0.5;
  int most = 0, least = std::numeric_limits<int>::max();
  for (const auto& [time, count] : frame_counts) {
    const bool nearer = std::fabs(time - 0.5) < std::fabs(best - 0.5);
    least = std::min(least, count);
    if (count > most || (count == most && nearer)) best = time, most = count;
  }
  return most > least ? best : 0.5;
}

Curriculum Curriculum::of(const TrainOptions& config, bool permanent) {
  if (!permanent) return {};
  const int iterations = config.train.iterations;
  return {std::min(config.motion.hexplane.warmup, iterations / 5),
          double(config.motion.hexplane.curriculum) * iterations, iterations};
}

double Curriculum::share(int step) const {
  return steps > 0 ? std::clamp((step - warmup) / steps, 0.0, 1.0) : 1;
}

double Curriculum::share_after(int step) const {
  const double begin = warmup + steps;
  return std::max(step - begin, 0.0) / std::max(iterations - begin, 1.0);
}

size_t Curriculum::view_at(size_t n, int step, uint32_t seed, size_t turn) const {
  const double done = share(step);
  if (done >= 1) return shuffled(n, seed, turn);
  const size_t front = std::min(n, kFrontViews);
  const size_t count = front + size_t(done * double(n - front));
  return turn % 2 ? shuffled(count, seed, turn / 2)
                  : count - front + shuffled(front, seed, turn / 2);
}

}  // namespace gflow
