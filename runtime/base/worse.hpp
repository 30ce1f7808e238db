// SPDX-License-Identifier: Apache-2.0
// The worst of several errors, where NaN is worst.
#pragma once
#include <algorithm>
#include <cmath>
#include <limits>

namespace gflow {

// The larger of `worst`, which is not NaN, and `error`; infinity if `error` is NaN, which
// std::max(worst, NaN) would ignore.
inline double worse(double worst, double error) {
  return std::isnan(error) ? std::numeric_limits<double>::infinity() : std::max(worst, error);
}

}  // namespace gflow
