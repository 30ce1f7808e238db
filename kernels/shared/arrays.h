// SPDX-License-Identifier: Apache-2.0
// Loads and stores rows of flat float arrays as vectors and matrices (OpenCL C only). Memory holds
// no float3, which is 16 bytes there.
#ifndef GFLOW_ARRAYS_H
#define GFLOW_ARRAYS_H
#include "shared/linear.h"

static inline real3 load3(global const float* p, uint i) {
  return make_real3(p[3 * i], p[3 * i + 1], p[3 * i + 2]);
}
static inline void store3(global float* p, uint i, real3 v) {
  p[3 * i] = v.x;
  p[3 * i + 1] = v.y;
  p[3 * i + 2] = v.z;
}
static inline void add3(global float* p, uint i, real3 v) { store3(p, i, load3(p, i) + v); }
static inline real4 load4(global const float* p, uint i) { return vload4(i, p); }
static inline void add4(global float* p, uint i, real4 v) { vstore4(vload4(i, p) + v, i, p); }
static inline Mat3 load_mat3(global const float* p, uint i) {
  Mat3 m;
  m.r1 = load3(p, 3 * i);
  m.r2 = load3(p, 3 * i + 1);
  m.r3 = load3(p, 3 * i + 2);
  return m;
}
static inline void store_mat3(global float* p, uint i, Mat3 m) {
  store3(p, 3 * i, m.r1);
  store3(p, 3 * i + 1, m.r2);
  store3(p, 3 * i + 2, m.r3);
}

#endif
