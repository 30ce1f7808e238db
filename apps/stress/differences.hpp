// SPDX-License-Identifier: Apache-2.0
// Slopes of functions in double, and how far apart two gradients are.
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

namespace gflow::stress {

// Gradient of f at x by central differences of steps h and h / 2, extrapolated: the error goes with
// h^4. Steps are relative for values above 1.
template <class F>
std::vector<double> slopes(F&& f, std::vector<double> x, double h) {
  std::vector<double> g(x.size());
  for (size_t i = 0; i < x.size(); ++i) {
    const double at = x[i], step = h * std::max(1., std::fabs(at));
    const auto central = [&](double d) {
      x[i] = at + d;
      const double above = f(x);
      x[i] = at - d;
      const double below = f(x);
      x[i] = at;
      return (above - below) / (2 * d);
    };
    g[i] = (4 * central(step / 2) - central(step)) / 3;
  }
  return g;
}

// |a - b| / |b|; infinite for different sizes, or where b is 0 and a is not.
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
