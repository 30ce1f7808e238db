// SPDX-License-Identifier: Apache-2.0
// The Pareto front of time and errors.
#pragma once
#include <algorithm>
#include <vector>

namespace gflow::bench {

// Time and errors of a choice, each in its own unit. All choices have the same number of errors.
struct TimeAndErrors {
  double time = 1;
  std::vector<double> errors;
};

// Whether each choice is on the front: no other one is as good in time and all errors and better in
// one of them. Tolerances cover the run-to-run spread of times and negligible differences of
// errors.
inline std::vector<bool> pareto_front(const std::vector<TimeAndErrors>& all) {
  constexpr double kSpread = 1.03, kSame = 1.03, kMoreExact = 1.1;
  const auto worse = [](const TimeAndErrors& a, const TimeAndErrors& b) {  // a than b
    const double time = a.time / b.time;
    double least = 1e300, most = 0;
    for (size_t k = 0; k < a.errors.size(); ++k) {
      const double ratio = a.errors[k] == b.errors[k] ? 1 : a.errors[k] / b.errors[k];  // 0 / 0
      least = std::min(least, ratio);
      most = std::max(most, ratio);
    }
    return time > 1 / kSpread && least > 1 / kSame && (time > kSpread || most > kMoreExact);
  };
  std::vector<bool> front;
  for (const TimeAndErrors& a : all)
    front.push_back(
        std::none_of(all.begin(), all.end(), [&](const TimeAndErrors& b) { return worse(a, b); }));
  return front;
}

}  // namespace gflow::bench
