// SPDX-License-Identifier: Apache-2.0
// The worst of many errors, where a value that is no number is the worst there is.
#pragma once
#include <algorithm>
#include <cmath>
#include <limits>

namespace gflow {

// The larger of the worst so far, which is a number, and one more; infinity for NaN, which
// std::max(worst, NaN) would pass over.
inline double worse(double worst, double error) {
  return std::isnan(error) ? std::numeric_limits<double>::infinity() : std::max(worst, error);
}

}  // namespace gflow
