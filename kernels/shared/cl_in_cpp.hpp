// SPDX-License-Identifier: Apache-2.0
// The part of OpenCL C that kernels/shared/ uses, in C++ and double precision, for the reference.
#pragma once
#include <algorithm>
#include <cmath>

using uint = unsigned int;

using real = double;
struct real2 {
  real x, y;
};
struct real3 {
  real x, y, z;
};
struct real4 {
  real x, y, z, w;
};
inline real2 make_real2(real x, real y) { return {x, y}; }
inline real3 make_real3(real x, real y, real z) { return {x, y, z}; }
inline real4 make_real4(real x, real y, real z, real w) { return {x, y, z, w}; }

inline real2 operator+(real2 a, real2 b) { return {a.x + b.x, a.y + b.y}; }
inline real2 operator-(real2 a, real2 b) { return {a.x - b.x, a.y - b.y}; }
inline real2 operator-(real2 a) { return {-a.x, -a.y}; }
inline real2 operator*(real2 a, real s) { return {a.x * s, a.y * s}; }
inline real2 operator*(real s, real2 a) { return a * s; }
inline real3 operator+(real3 a, real3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline real3 operator-(real3 a, real3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline real3 operator-(real3 a) { return {-a.x, -a.y, -a.z}; }
inline real3 operator*(real3 a, real s) { return {a.x * s, a.y * s, a.z * s}; }
inline real3 operator*(real s, real3 a) { return a * s; }
inline real4 operator+(real4 a, real4 b) { return {a.x + b.x, a.y + b.y, a.z + b.z, a.w + b.w}; }
inline real4 operator-(real4 a, real4 b) { return {a.x - b.x, a.y - b.y, a.z - b.z, a.w - b.w}; }
inline real4 operator-(real4 a) { return {-a.x, -a.y, -a.z, -a.w}; }
inline real4 operator*(real4 a, real s) { return {a.x * s, a.y * s, a.z * s, a.w * s}; }
inline real4 operator*(real s, real4 a) { return a * s; }
inline real dot(real2 a, real2 b) { return a.x * b.x + a.y * b.y; }
inline real dot(real3 a, real3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline real dot(real4 a, real4 b) { return a.x * b.x + a.y * b.y + a.z * b.z + a.w * b.w; }
inline real3 cross(real3 a, real3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
using std::cos;
using std::exp;
using std::exp2;
using std::expm1;
using std::fabs;
using std::fma;
using std::log;
using std::log1p;
using std::log2;
using std::sin;
using std::sqrt;
using std::tanh;
inline real4 exp(real4 x) { return {std::exp(x.x), std::exp(x.y), std::exp(x.z), std::exp(x.w)}; }
inline real fmin(real a, real b) { return a < b ? a : b; }
inline real fmax(real a, real b) { return a > b ? a : b; }
using std::pow;
inline real clamp(real x, real lo, real hi) { return fmin(fmax(x, lo), hi); }
inline int is_finite_real(real x) { return std::isfinite(x); }
