// SPDX-License-Identifier: Apache-2.0
// Projected splats as test cases for the device: float factors M [2, 3] in rows, and the same
// numbers in double.
#pragma once
#include "apps/stress/device_maths.hpp"
#include "apps/stress/errors.hpp"
#include "shared/quat.h"

namespace gflow::stress {

// An ellipse with standard deviations `along`, `across` and `depth` [px] at an angle; its long axis
// is tilted out of the image.
struct Axes {
  double along, across, depth, angle, tilt;
  Axes changed(Random& random, double change) const {
    return {along * std::exp(change * random.normal()), across * std::exp(change * random.normal()),
            depth, angle + change * random.normal(), tilt + change * random.normal()};
  }
};
inline Axes random_axes(Random& random, double along, double across) {
  return {along, across, across, random.angle(), random.uniform(-.5, .5)};
}
// Rotation of a factor's columns: none, one column per axis as in R diag(s); or random, as in
// factors sliced from four dimensions.
inline Mat3 mixture(Random& random, bool mixed) {
  if (!mixed) return mat3_identity();
  return quat_to_rotmat(
      quat_normalize({random.normal(), random.normal(), random.normal(), random.normal()}).q);
}
inline void add_factor(Floats& out, const Axes& a, const Mat3& mix) {
  const double co = std::cos(a.angle), si = std::sin(a.angle);
  for (const auto& [p, q] : {std::pair{co, -si}, {si, co}}) {
    const real3 row = mix.r1 * (p * a.along * std::cos(a.tilt)) + mix.r2 * (q * a.across) +
                      mix.r3 * (p * a.depth * std::sin(a.tilt));
    out.insert(out.end(), {float(row.x), float(row.y), float(row.z)});
  }
}

inline Mat23 factor_at(const Floats& m, size_t i) {
  const float* p = &m[6 * i];
  return {{p[0], p[1], p[2]}, {p[3], p[4], p[5]}};
}

inline std::vector<double> flat(Mat23 m) {
  return {m.r1.x, m.r1.y, m.r1.z, m.r2.x, m.r2.y, m.r2.z};
}

}  // namespace gflow::stress
