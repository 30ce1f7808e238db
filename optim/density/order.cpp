// SPDX-License-Identifier: Apache-2.0
#include "optim/density/order.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace gflow {
namespace {

constexpr int kAxisBits = 9, kTimeBits = 4;  // bits per axis; bits of time

// Range of the middle 98 % of the values, so that outliers do not make the cells large.
std::pair<float, float> range_of(const std::vector<float>& means, size_t axis) {
  std::vector<float> values;
  values.reserve(means.size() / 3);
  for (size_t i = axis; i < means.size(); i += 3)
    if (std::isfinite(means[i])) values.push_back(means[i]);
  if (values.empty()) return {0, 1};
  const size_t low = values.size() / 100, high = values.size() - 1 - low;
  std::nth_element(values.begin(), values.begin() + long(low), values.end());
  const float from = values[low];
  std::nth_element(values.begin(), values.begin() + long(high), values.end());
  return {from, std::max(values[high], std::nextafter(from, INFINITY))};
}

// The bits of x with two zeros between them.
uint32_t spread(uint32_t x) {
  uint32_t out = 0;
  for (int bit = 0; bit < kAxisBits; ++bit) out |= (x >> bit & 1u) << (3 * bit);
  return out;
}

// Index of the part of [0, 1] that contains x, of 2^bits equal parts.
uint32_t part_of(double x, int bits) {
  const int parts = 1 << bits;
  return uint32_t(std::clamp(int(std::clamp(x, 0.0, 1.0) * parts), 0, parts - 1));
}

}  // namespace

std::vector<uint32_t> order_of(const std::vector<float>& means, const std::vector<float>& means_t,
                               const std::vector<float>& log_scales, double duration) {
  const size_t n = means_t.size();
  std::pair<float, float> ranges[3];
  for (size_t axis = 0; axis < 3; ++axis) ranges[axis] = range_of(means, axis);
  std::vector<uint32_t> keys(n), order(n);
  for (size_t i = 0; i < n; ++i) {
    const double life = std::exp(double(log_scales[4 * i + 3])), moment = means_t[i] / duration;
    const float* mean = &means[3 * i];
    const double sum = double(mean[0]) + mean[1] + mean[2] + moment + life;
    if (!std::isfinite(sum)) {
      keys[i] = ~0u;
      continue;
    }
    // with lifetime > duration / 8, a window of +-2 lifetimes is at least half the video
    const uint32_t time = life > duration / 8 ? 0 : 1 + part_of(moment, kTimeBits);
    uint32_t place = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      const auto [from, to] = ranges[axis];
      const double x = (double(mean[axis]) - from) / (double(to) - from);
      place |= spread(part_of(x, kAxisBits)) << axis;
    }
    keys[i] = time << (3 * kAxisBits) | place;
  }
  std::iota(order.begin(), order.end(), 0u);
  std::stable_sort(order.begin(), order.end(),
                   [&](uint32_t a, uint32_t b) { return keys[a] < keys[b]; });
  return order;
}

const Buffer<cl_uint>& RowOrder::sort(Queue& queue, Parameters& p, double duration) {
  source_.ensure(queue, p.count);
  source_.write(queue, order_of(p["means"].values.read(queue), p["means_t"].values.read(queue),
                                p["log_scales"].values.read(queue), duration));
  child_.ensure(queue, p.count);
  child_.fill(queue, 0u);
  if (p.count > 0) rows_.move(queue, p, p.count, source_, child_, false);
  return source_;
}

}  // namespace gflow
