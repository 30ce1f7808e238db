// SPDX-License-Identifier: Apache-2.0
// Numerical derivatives in double, and comparison of gradients.
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

namespace gflow::stress {

// Derivatives of f at x by the components in `which`: central differences with steps h and h / 2,
// extrapolated to an error of order h^4. Steps are relative for values above 1.
template <class F>
std::vector<double> slopes(F&& f, std::vector<double> x, double h,
                           const std::vector<size_t>& which) {
  std::vector<double> g;
  for (const size_t i : which) {
    const double at = x[i], step = h * std::max(1., std::fabs(at));
    const auto central = [&](double d) {
      x[i] = at + d;
      const double above = f(x);
      x[i] = at - d;
      const double below = f(x);
      x[i] = at;
      return (above - below) / (2 * d);
    };
    g.push_back((4 * central(step / 2) - central(step)) / 3);
  }
  return g;
}

// Evenly spaced indices below `size`, about `most` of them at most.
inline std::vector<size_t> spread_indices(size_t size, size_t most) {
  if (size == 0) return {};
  std::vector<size_t> which;
  for (size_t i = 0; i < size; i += std::max<size_t>(1, size / most)) which.push_back(i);
  return which;
}
// By all components.
template <class F>
std::vector<double> slopes(F&& f, const std::vector<double>& x, double h) {
  return slopes(f, x, h, spread_indices(x.size(), x.size()));
}
template <class T>
std::vector<T> picked(const std::vector<T>& values, const std::vector<size_t>& which) {
  std::vector<T> some;
  for (const size_t i : which) some.push_back(values[i]);
  return some;
}

// a - b| / |b|; infinite for different sizes, or if b is 0 and a is not.
template <class A, class B>
double relative_error(const std::vector<A>& a, const std::vector<B>& b) {
  if (a.size() != b.size() || a.empty()) return HUGE_VAL;
  double difference = 0, length = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    const double d = double(a[i]) - double(b[i]);
    difference += d * d;
    length += double(b[i]) * double(b[i]);
  }
  return difference == 0 ? 0 : length > 0 ? std::sqrt(difference / length) : HUGE_VAL;
}

}  // namespace gflow::stress
