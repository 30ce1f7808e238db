// SPDX-License-Identifier: Apache-2.0
// A static Gaussian and its shift as one list of 13 + 10 numbers.
#pragma once
#include "shared/motion/shifted.h"

namespace gflow::reference {

inline Canonical canonical_from(const std::vector<double>& x) {
  return {{x[0], x[1], x[2]}, x[3], {x[4], x[5], x[6], x[7]}, {x[8], x[9], x[10], x[11]}, x[12]};
}
inline Shift shift_from(const std::vector<double>& x) {
  return {{x[13], x[14], x[15]}, {x[16], x[17], x[18], x[19]}, {x[20], x[21], x[22]}};
}
// Gradients of both from the gradient of the shifted Gaussian, since the shift is additive.
inline std::vector<double> canonical_and_shift(const Canonical& v) {
  return {v.mean.x,        v.mean.y, v.mean.z,       v.mean_t,       v.quat.x,       v.quat.y,
          v.quat.z,        v.quat.w, v.log_scales.x, v.log_scales.y, v.log_scales.z, v.log_scales.w,
          v.logit_opacity, v.mean.x, v.mean.y,       v.mean.z,       v.quat.x,       v.quat.y,
          v.quat.z,        v.quat.w, v.log_scales.x, v.log_scales.y, v.log_scales.z};
}
template <class Random>
std::vector<double> random_still_and_shift(Random& random) {
  std::vector<double> x(23);
  for (double& value : x) value = random();
  return x;
}

}  // namespace gflow::reference
