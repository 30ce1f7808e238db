// SPDX-License-Identifier: Apache-2.0
// Statistics of errors, and random numbers for test cases.
#pragma once
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "runtime/base/worse.hpp"

namespace gflow::stress {

constexpr double infinite = std::numeric_limits<double>::infinity();

// The smallest error that at least a fraction `share` of the errors do not exceed; NaN counts as
// infinite.
inline double quantile(std::vector<double> errors, double share) {
  if (errors.empty()) return infinite;  // nothing was measured: must fail
  for (double& e : errors)
    if (std::isnan(e)) e = infinite;
  std::sort(errors.begin(), errors.end());
  const size_t rank = size_t(std::ceil(share * double(errors.size())));
  return errors[std::min(std::max<size_t>(rank, 1), errors.size()) - 1];
}
inline double worst(const std::vector<double>& errors) { return quantile(errors, 1); }

// actual - expected| / |expected| of `width` values from i * width on, by the Euclidean norm.
template <class A, class E>
double row_error(const std::vector<A>& actual, const std::vector<E>& expected, size_t i,
                 size_t width) {
  double difference = 0, length = 0;
  for (size_t k = i * width; k < (i + 1) * width; ++k) {
    const double d = double(actual[k]) - double(expected[k]);
    difference += d * d;
    length += double(expected[k]) * double(expected[k]);
  }
  if (difference == 0) return 0;
  return length > 0 ? std::sqrt(difference / length) : infinite;
}

inline double count_not_finite(const std::vector<float>& values) {
  return double(
      std::count_if(values.begin(), values.end(), [](float x) { return !std::isfinite(x); }));
}

// Bound on the share of doubtful pixels, which a comparison leaves out because rounding may decide
// there: each of a pixel's forty or so layers is at the cut-off with a probability of 1e-4 or less.
constexpr double kMostDoubtful = .02;
inline double share_of(const std::vector<uint8_t>& doubtful) {
  return double(std::count(doubtful.begin(), doubtful.end(), 1)) / double(doubtful.size());
}

// T29: values that a broken slot may contain.
inline std::vector<float> poisons() {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = HUGE_VALF;
  return {nan,    -nan,    inf,    -inf,    3e38f,  -3e38f,  1e30f, -1e30f,
          1e19f,  -1e19f,  2e9f,   -2e9f,   1e6f,   -1e6f,   1e-6f, -1e-6f,
          1e-20f, -1e-20f, 1e-38f, -1e-38f, 1e-42f, -1e-42f, 0.f,   -0.f};
}

// Seeded; the same numbers with every standard library.
class Random {
 public:
  explicit Random(unsigned seed) : rng_(seed) {}
  double uniform(double lo, double hi) { return lo + (hi - lo) * (double(rng_()) / 4294967296.0); }
  double normal() {
    return std::sqrt(-2 * std::log(uniform(1e-12, 1))) *
           std::cos(6.283185307179586 * uniform(0, 1));
  }
  double angle() { return uniform(0, 6.283185307179586); }

 private:
  std::mt19937 rng_;
};

}  // namespace gflow::stress
