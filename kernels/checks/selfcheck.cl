// SPDX-License-Identifier: Apache-2.0
// The device arithmetic that gflow relies on, computed for the host to check.
#include "shared/projection.h"

// One work-item per element.
kernel void check_maths(const uint n, global const float* restrict exponents,  // [n]
                        global const float* restrict positives,                // [n]
                        global const float* restrict divisors,                 // [n]
                        global const float* restrict factors,                  // [n, 2, 3]
                        global float* restrict exp2s,                          // [n]
                        global float* restrict square_roots,                   // [n]
                        global float* restrict quotients,                      // [n]
                        global float* restrict determinants) {                 // [n]
  const uint i = get_global_id(0);
  if (i >= n) return;
  exp2s[i] = exp2(exponents[i]);
  square_roots[i] = sqrt(positives[i]);
  quotients[i] = positives[i] / divisors[i];
  determinants[i] = whiten(make_mat23(vload3(2 * i, factors), vload3(2 * i + 1, factors))).det;
}

// One work-item per element: bit 0 = finite by its bits, bit 1 = differs from itself,
// bit 2 = fails the guard "is positive" as kernels phrase it, so that NaN fails too.
kernel void check_nan_tests(const uint n, global const float* restrict values,  // [n]
                            global uint* restrict flags) {                      // [n]
  const uint i = get_global_id(0);
  if (i >= n) return;
  const float x = values[i];
  uint flag = is_finite_real(x) ? 1 : 0;
  if (x != x) flag |= 2;
  if (!(x > 0)) flag |= 4;
  flags[i] = flag;
}
