// SPDX-License-Identifier: Apache-2.0
// Reference for a device's determinants and exponents. Does not use shared/projection.h, whose
// errors the device's and the host's whiten() would share.
#pragma once
#include "shared/constants.h"

namespace gflow {

// S = M M^T + DILATION I = [[a, b], [b, c]] of a float factor M [2, 3] in rows [px]. A long double
// has 64 bits or more and holds products of floats exactly: a c - b b of a splat 1e5 times as long
// as wide keeps nine digits.
struct ExactCovariance {
  long double a = DILATION, b = 0, c = DILATION;

  explicit ExactCovariance(const float* m) {
    for (int k = 0; k < 3; ++k) {
      const long double x = m[k], y = m[3 + k];
      a += x * x;
      b += x * y;
      c += y * y;
    }
  }
  double det() const { return double(a * c - b * b); }
  // d^T inv(S) d; a Gaussian's exponent is minus half of it.
  double distance2(double x, double y) const {
    return double((c * x * x - 2 * b * x * y + a * y * y) / (a * c - b * b));
  }
};

}  // namespace gflow
